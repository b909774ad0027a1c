package org.rayfarm.agent;

import java.io.IOException;
import java.io.InputStream;

/** Halts the process when standard input ends, which is when adb or the caller is gone. */
final class CallerWatch implements Runnable {
    private final Session session;

    private CallerWatch(Session session) {
        this.session = session;
    }

    static void start(Session session) {
        Thread thread = new Thread(new CallerWatch(session), "caller");
        thread.setDaemon(true);
        thread.start();
    }

    @Override
    public void run() {
        byte[] unread = new byte[256];
        InputStream in = System.in;
        try {
            while (in.read(unread) >= 0) {
                continue;
            }
        } catch (IOException error) {
            // As good as its end.
        }
        session.abandon();
        Exit.now(Main.CALLER_GONE);
    }
}
