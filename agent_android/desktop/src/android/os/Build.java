package android.os;

/** Stands in for Android's class on the desktop; the model can be set by RAYFARM_SHIM_MODEL. */
public class Build {
    public static final String BOARD = text("none");
    public static final String DEVICE = text("desktop");
    public static final String FINGERPRINT = text("rayfarm/desktop");
    public static final String HARDWARE = text(System.getProperty("os.arch"));
    public static final String MANUFACTURER = text("RayFarm");
    public static final String MODEL = text(System.getenv().getOrDefault("RAYFARM_SHIM_MODEL", "stand-in"));

    /** Stands in for Android's class. */
    public static class VERSION {
        public static final String RELEASE = text("10");
        public static final int SDK_INT = Integer.parseInt("29");
    }

    /** Keeps the compiler from copying a value into its users. */
    private static String text(String value) {
        return String.valueOf(value);
    }
}
