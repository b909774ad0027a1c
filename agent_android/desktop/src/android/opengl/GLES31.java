package android.opengl;

/** Stands in for Android's class on the desktop, as far as the agent calls it. */
public class GLES31 extends GLES30 {
    public static void glBindImageTexture(int unit, int texture, int level, boolean layered, int layer, int access,
            int format) {
        org.lwjgl.opengles.GLES31.glBindImageTexture(unit, texture, level, layered, layer, access, format);
    }

    public static void glDispatchCompute(int x, int y, int z) {
        org.lwjgl.opengles.GLES31.glDispatchCompute(x, y, z);
    }

    public static void glMemoryBarrier(int barriers) {
        org.lwjgl.opengles.GLES31.glMemoryBarrier(barriers);
    }
}
