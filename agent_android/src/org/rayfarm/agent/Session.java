package org.rayfarm.agent;

/** One command: what it does in order, and how it ends. Every way of ending goes through the record. */
final class Session {
    private final Arguments arguments;
    private final Phases phases;
    private final Record record;
    private volatile String doing = "starting";
    private volatile int frame;

    Session(Arguments arguments, Phases phases) {
        this.arguments = arguments;
        this.phases = phases;
        record = new Record(arguments.token, arguments.out);
    }

    /** Do the work and write the record; the process's exit code. */
    int run() {
        Thread deadline = Deadline.start(this, arguments.deadlineSeconds);
        String outcome = AgentException.FAILED;
        String reason;
        try {
            record.clear();
            work();
            outcome = AgentException.DONE;
            reason = null;
        } catch (AgentException error) {
            outcome = error.outcome;
            reason = error.getMessage();
        } catch (OutOfMemoryError error) {
            reason = "The agent ran out of memory while " + now() + ".";
        } catch (Throwable error) {
            error.printStackTrace();
            reason = "The agent failed while " + now() + ": " + error + ".";
        }
        if (!record.claim()) {
            // The deadline is writing the record, or the caller is gone: they halt the process.
            join(deadline);
        }
        boolean written = end(outcome, reason);
        deadline.interrupt();
        return written && outcome.equals(AgentException.DONE) ? Main.DONE : Main.NOT_DONE;
    }

    /** Write the record of a run that is over its deadline; false if another thread is at its end. */
    boolean expire() {
        if (!record.claim()) {
            return false;
        }
        String sentence = "The run did not end within its deadline of " + arguments.deadlineSeconds + " s: it was "
                + now() + ".";
        end(AgentException.DEADLINE, sentence);
        return true;
    }

    /** Leave nothing behind that this run wrote. */
    void abandon() {
        record.abandon();
    }

    /** What is being done, for the sentences of errors. */
    void doing(String what) {
        doing = what;
        frame = 0;
    }

    /** That a timed frame, counted from 1, is being run; allocates nothing. */
    void frame(int number) {
        frame = number;
    }

    void say(String phase) {
        phases.say(phase);
    }

    private void work() throws Exception {
        if (!arguments.version.equals(Version.VERSION)) {
            throw AgentException.refused("This agent is " + Version.VERSION + " and the caller wants "
                    + arguments.version + ": push the agent again.");
        }
        say("ready");
        doing("opening an OpenGL ES context");
        GlContext context = GlContext.open();
        try {
            Device device = new Device(context);
            record.put("device", device.json());
            if (arguments.probe) {
                doing("probing");
                Probe.run(device, arguments, record);
            } else {
                new Run(this, arguments, device, record).run();
            }
        } finally {
            context.close();
        }
    }

    private String now() {
        return frame == 0 ? doing : "running frame " + frame;
    }

    private static void join(Thread thread) {
        try {
            thread.join();
        } catch (InterruptedException error) {
            Thread.currentThread().interrupt();
        }
    }

    private boolean end(String outcome, String reason) {
        boolean written = record.write(outcome, reason);
        if (written) {
            say("done");
        }
        return written;
    }
}
