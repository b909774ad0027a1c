package android.util;

/** Writes as `logcat` prints: on standard output, which `am` sends to the log. */
public final class Log {
    private Log() {
    }

    /** Information. */
    public static int i(String tag, String message) {
        return line('I', tag, message);
    }

    /** An error. */
    public static int e(String tag, String message) {
        return line('E', tag, message);
    }

    private static int line(char priority, String tag, String message) {
        System.out.println(priority + "/" + tag + ": " + message);
        return 0;
    }
}
