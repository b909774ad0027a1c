package android.opengl;

/** Stands in for Android's class on the desktop. */
public abstract class EGLObjectHandle {
    private final long handle;

    protected EGLObjectHandle(long handle) {
        this.handle = handle;
    }

    public long getNativeHandle() {
        return handle;
    }

    @Override
    public int hashCode() {
        return Long.hashCode(handle);
    }

    boolean same(Object other) {
        return other != null && other.getClass() == getClass() && ((EGLObjectHandle) other).handle == handle;
    }
}
