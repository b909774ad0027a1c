package org.rayfarm.agent;

import android.os.Process;

/** Ends the process for certain. */
final class Exit implements Runnable {
    /** How long a driver's own exit handlers may take. */
    private static final long PATIENCE_MS = 2000;

    private Exit() {
    }

    static void now(int code) {
        // On Android halt() still runs the exit handlers of native libraries, where a hung driver hangs.
        Thread killer = new Thread(new Exit(), "exit");
        killer.setDaemon(true);
        killer.start();
        Runtime.getRuntime().halt(code);
    }

    @Override
    public void run() {
        try {
            Thread.sleep(PATIENCE_MS);
        } catch (InterruptedException error) {
            // The sooner.
        }
        Process.killProcess(Process.myPid());
    }
}
