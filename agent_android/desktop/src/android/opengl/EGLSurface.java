package android.opengl;

/** Stands in for Android's class on the desktop. */
public class EGLSurface extends EGLObjectHandle {
    EGLSurface(long handle) {
        super(handle);
    }

    @Override
    public boolean equals(Object other) {
        return same(other);
    }
}
