package org.rayfarm.agent;

/** Ends the process at its deadline, whatever a driver is doing. */
final class Deadline implements Runnable {
    /** How long a record that is being written at the deadline may still take. */
    private static final long GRACE_MS = 10000;

    private final Session session;
    private final long end;

    private Deadline(Session session, double seconds) {
        this.session = session;
        end = System.nanoTime() + (long) (seconds * 1e9);
    }

    static Thread start(Session session, double seconds) {
        Thread thread = new Thread(new Deadline(session, seconds), "deadline");
        thread.setDaemon(true);
        thread.start();
        return thread;
    }

    @Override
    public void run() {
        try {
            for (long left = end - System.nanoTime(); left > 0; left = end - System.nanoTime()) {
                Thread.sleep(left / 1000000 + 1);
            }
            if (!session.expire()) {
                Thread.sleep(GRACE_MS);
            }
        } catch (InterruptedException error) {
            return;
        }
        Exit.now(Main.NOT_DONE);
    }
}
