package android.view;

/** A window that shows nothing. */
public class Window {
    /** Nothing to keep on. */
    public void addFlags(int flags) {
    }
}
