package org.rayfarm.agent;

import java.io.File;

/** The way in by app_process; README.md has the command line. */
public final class Main {
    /** The process's exit codes; only the record says how the run went. */
    static final int DONE = 0;
    static final int NOT_DONE = 1;
    static final int USAGE = 2;
    static final int CALLER_GONE = 3;

    private Main() {
    }

    /** Run one command and end the process. */
    public static void main(String[] words) {
        int code = run(words);
        System.out.flush();
        System.err.flush();
        Exit.now(code);
    }

    private static int run(String[] words) {
        Arguments arguments;
        try {
            arguments = new Arguments(words, null);
        } catch (AgentException error) {
            System.err.println(error.getMessage());
            return USAGE;
        }
        Session session = new Session(arguments, console());
        CallerWatch.start(session);
        return session.run();
    }

    private static Phases console() {
        return new Phases() {
            @Override
            public void say(String phase) {
                System.out.println("rayfarm " + phase);
                System.out.flush();
            }
        };
    }
}
