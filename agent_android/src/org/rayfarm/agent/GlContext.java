package org.rayfarm.agent;

import android.opengl.EGL14;
import android.opengl.EGLConfig;
import android.opengl.EGLContext;
import android.opengl.EGLDisplay;
import android.opengl.EGLExt;
import android.opengl.EGLSurface;
import android.opengl.GLES20;
import android.opengl.GLES30;

/** An OpenGL ES 3.1 context without a window, current on the thread that opened it. */
final class GlContext {
    /** EGL_CONTEXT_MINOR_VERSION of EGL 1.5 and EGL_KHR_create_context. */
    private static final int MINOR_VERSION = 0x30FB;

    private final EGLDisplay display;
    private EGLContext context = EGL14.EGL_NO_CONTEXT;
    private EGLSurface surface = EGL14.EGL_NO_SURFACE;

    private GlContext(EGLDisplay display) {
        this.display = display;
    }

    /**
     * Open a context on a pbuffer of one pixel, or on no surface where there is no pbuffer.
     *
     * @throws AgentException naming the EGL call that failed; refused for a version before 3.1
     */
    static GlContext open() throws AgentException {
        EGLDisplay display = EGL14.eglGetDisplay(EGL14.EGL_DEFAULT_DISPLAY);
        int[] version = new int[2];
        if (!EGL14.eglInitialize(display, version, 0, version, 1)) {
            throw failure("eglInitialize");
        }
        GlContext opened = new GlContext(display);
        try {
            opened.create();
            checkVersion();
        } catch (AgentException error) {
            opened.close();
            throw error;
        }
        return opened;
    }

    String version() {
        return EGL14.eglQueryString(display, EGL14.EGL_VERSION);
    }

    void close() {
        EGL14.eglMakeCurrent(display, EGL14.EGL_NO_SURFACE, EGL14.EGL_NO_SURFACE, EGL14.EGL_NO_CONTEXT);
        if (!surface.equals(EGL14.EGL_NO_SURFACE)) {
            EGL14.eglDestroySurface(display, surface);
        }
        if (!context.equals(EGL14.EGL_NO_CONTEXT)) {
            EGL14.eglDestroyContext(display, context);
        }
        EGL14.eglTerminate(display);
    }

    private void create() throws AgentException {
        EGLConfig config = config(EGL14.EGL_PBUFFER_BIT);
        if (config != null) {
            int[] pixel = {EGL14.EGL_WIDTH, 1, EGL14.EGL_HEIGHT, 1, EGL14.EGL_NONE};
            surface = EGL14.eglCreatePbufferSurface(display, config, pixel, 0);
        } else {
            config = config(0);
        }
        if (config == null) {
            throw failure("eglChooseConfig for OpenGL ES 3");
        }
        int[] exact = {EGL14.EGL_CONTEXT_CLIENT_VERSION, 3, MINOR_VERSION, 1, EGL14.EGL_NONE};
        int[] any = {EGL14.EGL_CONTEXT_CLIENT_VERSION, 3, EGL14.EGL_NONE};
        context = EGL14.eglCreateContext(display, config, EGL14.EGL_NO_CONTEXT, exact, 0);
        if (context.equals(EGL14.EGL_NO_CONTEXT)) {
            context = EGL14.eglCreateContext(display, config, EGL14.EGL_NO_CONTEXT, any, 0);
        }
        if (context.equals(EGL14.EGL_NO_CONTEXT)) {
            throw failure("eglCreateContext for OpenGL ES 3");
        }
        if (!EGL14.eglMakeCurrent(display, surface, surface, context)) {
            throw failure("eglMakeCurrent");
        }
    }

    private EGLConfig config(int surfaceBits) {
        int[] wanted = {
            EGL14.EGL_RENDERABLE_TYPE, EGLExt.EGL_OPENGL_ES3_BIT_KHR, EGL14.EGL_SURFACE_TYPE, surfaceBits,
            EGL14.EGL_RED_SIZE, 8, EGL14.EGL_GREEN_SIZE, 8, EGL14.EGL_BLUE_SIZE, 8, EGL14.EGL_NONE
        };
        EGLConfig[] found = new EGLConfig[1];
        int[] count = new int[1];
        boolean chosen = EGL14.eglChooseConfig(display, wanted, 0, found, 0, 1, count, 0);
        return chosen && count[0] > 0 ? found[0] : null;
    }

    private static void checkVersion() throws AgentException {
        int[] version = new int[2];
        GLES20.glGetIntegerv(GLES30.GL_MAJOR_VERSION, version, 0);
        GLES20.glGetIntegerv(GLES30.GL_MINOR_VERSION, version, 1);
        if (version[0] * 10 + version[1] < 31) {
            throw AgentException.refused("This device offers OpenGL ES " + version[0] + "." + version[1]
                    + "; the agent needs 3.1.");
        }
    }

    private static AgentException failure(String call) {
        return AgentException.failed("EGL reports 0x" + Integer.toHexString(EGL14.eglGetError()) + " from " + call
                + ": no OpenGL ES context can be made without a window here.");
    }
}
