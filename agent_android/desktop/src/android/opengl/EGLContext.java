package android.opengl;

/** Stands in for Android's class on the desktop. */
public class EGLContext extends EGLObjectHandle {
    EGLContext(long handle) {
        super(handle);
    }

    @Override
    public boolean equals(Object other) {
        return same(other);
    }
}
