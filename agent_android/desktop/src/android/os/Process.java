package android.os;

import com.sun.management.OperatingSystemMXBean;
import java.io.IOException;
import java.lang.management.ManagementFactory;

/** Stands in for Android's class on the desktop, as far as the agent calls it. */
public class Process {
    private static final OperatingSystemMXBean SYSTEM =
            (OperatingSystemMXBean) ManagementFactory.getOperatingSystemMXBean();

    public static final int myPid() {
        return (int) ProcessHandle.current().pid();
    }

    public static final void killProcess(int pid) {
        try {
            new ProcessBuilder("kill", "-9", String.valueOf(pid)).start();
        } catch (IOException error) {
            throw new IllegalStateException(error);
        }
    }

    public static final long getElapsedCpuTime() {
        return SYSTEM.getProcessCpuTime() / 1000000;
    }
}
