package android.opengl;

import java.nio.IntBuffer;
import org.lwjgl.PointerBuffer;
import org.lwjgl.egl.EGL;
import org.lwjgl.egl.EGL10;
import org.lwjgl.opengles.GLES;
import org.lwjgl.system.MemoryStack;

/** Stands in for Android's class on the desktop, as far as the agent calls it. */
public class EGL14 {
    public static EGLContext EGL_NO_CONTEXT = new EGLContext(0);
    public static EGLDisplay EGL_NO_DISPLAY = new EGLDisplay(0);
    public static EGLSurface EGL_NO_SURFACE = new EGLSurface(0);

    public static int eglGetError() {
        return EGL10.eglGetError();
    }

    public static EGLDisplay eglGetDisplay(int display) {
        return new EGLDisplay(EGL10.eglGetDisplay(display));
    }

    public static boolean eglInitialize(EGLDisplay dpy, int[] major, int majorOffset, int[] minor, int minorOffset) {
        int[] first = new int[1];
        int[] second = new int[1];
        boolean done = EGL10.eglInitialize(dpy.getNativeHandle(), first, second);
        major[majorOffset] = first[0];
        minor[minorOffset] = second[0];
        if (done) {
            EGL.createDisplayCapabilities(dpy.getNativeHandle(), first[0], second[0]);
        }
        return done;
    }

    public static boolean eglTerminate(EGLDisplay dpy) {
        return EGL10.eglTerminate(dpy.getNativeHandle());
    }

    public static String eglQueryString(EGLDisplay dpy, int name) {
        return EGL10.eglQueryString(dpy.getNativeHandle(), name);
    }

    public static boolean eglChooseConfig(EGLDisplay dpy, int[] attribs, int attribsOffset, EGLConfig[] configs,
            int configsOffset, int configSize, int[] count, int countOffset) {
        try (MemoryStack stack = MemoryStack.stackPush()) {
            PointerBuffer found = stack.mallocPointer(configSize);
            IntBuffer number = stack.mallocInt(1);
            IntBuffer wanted = stack.ints(attribs).position(attribsOffset);
            boolean done = EGL10.eglChooseConfig(dpy.getNativeHandle(), wanted, found, number);
            count[countOffset] = number.get(0);
            for (int i = 0; i < number.get(0); i++) {
                configs[configsOffset + i] = new EGLConfig(found.get(i));
            }
            return done;
        }
    }

    public static EGLSurface eglCreatePbufferSurface(EGLDisplay dpy, EGLConfig config, int[] attribs, int offset) {
        try (MemoryStack stack = MemoryStack.stackPush()) {
            IntBuffer wanted = stack.ints(attribs).position(offset);
            long made = EGL10.eglCreatePbufferSurface(dpy.getNativeHandle(), config.getNativeHandle(), wanted);
            return new EGLSurface(made);
        }
    }

    public static boolean eglDestroySurface(EGLDisplay dpy, EGLSurface surface) {
        return EGL10.eglDestroySurface(dpy.getNativeHandle(), surface.getNativeHandle());
    }

    public static EGLContext eglCreateContext(EGLDisplay dpy, EGLConfig config, EGLContext share, int[] attribs,
            int offset) {
        try (MemoryStack stack = MemoryStack.stackPush()) {
            IntBuffer wanted = stack.ints(attribs).position(offset);
            return new EGLContext(EGL10.eglCreateContext(dpy.getNativeHandle(), config.getNativeHandle(),
                    share.getNativeHandle(), wanted));
        }
    }

    public static boolean eglDestroyContext(EGLDisplay dpy, EGLContext context) {
        return EGL10.eglDestroyContext(dpy.getNativeHandle(), context.getNativeHandle());
    }

    public static boolean eglMakeCurrent(EGLDisplay dpy, EGLSurface draw, EGLSurface read, EGLContext context) {
        boolean done = EGL10.eglMakeCurrent(dpy.getNativeHandle(), draw.getNativeHandle(), read.getNativeHandle(),
                context.getNativeHandle());
        if (done && context.getNativeHandle() != 0) {
            GLES.createCapabilities();
        }
        return done;
    }
}
