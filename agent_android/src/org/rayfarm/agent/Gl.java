package org.rayfarm.agent;

import android.opengl.GLES20;
import android.opengl.GLES30;

/** OpenGL's errors as sentences. */
final class Gl {
    private static final int STACK_OVERFLOW = 0x0503;
    private static final int STACK_UNDERFLOW = 0x0504;
    private static final int CONTEXT_LOST = 0x0507;
    private static final int FLAGS = 8;

    private Gl() {
    }

    /**
     * Look at the error flag.
     *
     * @param doing what was done, as in "while uploading nodes"
     */
    static void check(String doing) throws AgentException {
        int error = GLES20.glGetError();
        if (error == GLES20.GL_NO_ERROR) {
            return;
        }
        String advice = "";
        if (error == GLES20.GL_OUT_OF_MEMORY) {
            advice = ": the device has too little memory for this plan";
        } else if (error == CONTEXT_LOST) {
            advice = ": the driver gave the context up, most often because one submission took too long";
        }
        throw AgentException.failed("OpenGL reports " + name(error) + " while " + doing + advice + ".");
    }

    /** Clear the error flags after a try that may fail; whether any was set. */
    static boolean failed() {
        boolean failed = false;
        // A lost context may report errors for ever.
        for (int i = 0; i < FLAGS && GLES20.glGetError() != GLES20.GL_NO_ERROR; i++) {
            failed = true;
        }
        return failed;
    }

    /** Whether the framebuffer that is bound can be drawn into. */
    static boolean complete() {
        return GLES20.glCheckFramebufferStatus(GLES30.GL_DRAW_FRAMEBUFFER) == GLES20.GL_FRAMEBUFFER_COMPLETE;
    }

    private static String name(int error) {
        switch (error) {
            case GLES20.GL_INVALID_ENUM:
                return "GL_INVALID_ENUM";
            case GLES20.GL_INVALID_VALUE:
                return "GL_INVALID_VALUE";
            case GLES20.GL_INVALID_OPERATION:
                return "GL_INVALID_OPERATION";
            case GLES20.GL_INVALID_FRAMEBUFFER_OPERATION:
                return "GL_INVALID_FRAMEBUFFER_OPERATION";
            case GLES20.GL_OUT_OF_MEMORY:
                return "GL_OUT_OF_MEMORY";
            case STACK_OVERFLOW:
            case STACK_UNDERFLOW:
                return "a stack error";
            case CONTEXT_LOST:
                return "GL_CONTEXT_LOST";
            default:
                return "error 0x" + Integer.toHexString(error);
        }
    }
}
