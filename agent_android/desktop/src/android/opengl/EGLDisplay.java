package android.opengl;

/** Stands in for Android's class on the desktop. */
public class EGLDisplay extends EGLObjectHandle {
    EGLDisplay(long handle) {
        super(handle);
    }

    @Override
    public boolean equals(Object other) {
        return same(other);
    }
}
