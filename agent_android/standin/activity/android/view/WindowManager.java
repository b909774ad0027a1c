package android.view;

/** Holds the flags' names. */
public interface WindowManager {
    /** The flags. */
    class LayoutParams {
        /** Android's value. */
        public static final int FLAG_KEEP_SCREEN_ON = 0x80;
    }
}
