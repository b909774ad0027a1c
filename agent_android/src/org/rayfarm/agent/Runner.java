package org.rayfarm.agent;

import android.opengl.GLES20;
import android.opengl.GLES30;
import android.opengl.GLES31;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.util.ArrayList;
import java.util.List;

/** A plan made ready on the current context, as renderer/twin.py runs it. Holds no traversal and no scene logic. */
final class Runner {
    private final Plan plan;
    private final Resources resources;
    private final Step[] setup;
    private final Step[] frame;

    Runner(Plan plan, Resources resources) throws AgentException {
        this.plan = plan;
        this.resources = resources;
        // Scenes are drawn as they are: no culling, no blending, and no dithering of what is read back.
        GLES20.glDisable(GLES20.GL_DITHER);
        setShared();
        setup = steps(true);
        frame = steps(false);
        Gl.check("making the passes ready");
    }

    /** Run the passes that run once, and one frame, to completion; the collector, which may be null, gets the frame's tiles. */
    void first(Collector collector) throws Exception {
        checked(setup, null);
        checked(frame, collector);
    }

    /** Submit one frame. */
    void frame() throws Exception {
        for (Step step : frame) {
            step.run(null);
        }
    }

    /** A collector that reads each tile's whole buffer back into blobs. */
    Collector collector(final Blobs blobs) {
        return new Collector() {
            @Override
            public void collect(String buffer, int x, int y, int width, int height) throws Exception {
                int bytes = bytes(buffer);
                int target = GLES31.GL_SHADER_STORAGE_BUFFER;
                GLES20.glBindBuffer(target, resources.buffers.get(buffer));
                ByteBuffer words =
                        (ByteBuffer) GLES30.glMapBufferRange(target, 0, bytes, GLES30.GL_MAP_READ_BIT);
                Gl.check("reading the buffer " + buffer + " back");
                blobs.append(buffer, x, y, width, height, words.order(ByteOrder.LITTLE_ENDIAN));
                GLES30.glUnmapBuffer(target);
            }
        };
    }

    /** Read the output texture, RGBA8, row 0 at the bottom, into a blob. */
    void readImage(Blobs blobs) throws Exception {
        List<String> names = new ArrayList<String>();
        names.add(plan.output);
        GLES20.glBindFramebuffer(GLES20.GL_FRAMEBUFFER, resources.framebuffer(names));
        ByteBuffer pixels = ByteBuffer.allocateDirect(plan.width * plan.height * 4).order(ByteOrder.LITTLE_ENDIAN);
        GLES20.glReadPixels(0, 0, plan.width, plan.height, GLES20.GL_RGBA, GLES20.GL_UNSIGNED_BYTE, pixels);
        Gl.check("reading the image back");
        pixels.rewind();
        blobs.append("image", 0, 0, plan.width, plan.height, pixels);
    }

    private static void checked(Step[] steps, Collector collector) throws Exception {
        for (Step step : steps) {
            step.run(collector);
            GLES20.glFinish();
            Gl.check("running the pass " + step.pass.name);
        }
    }

    private int bytes(String name) {
        for (Plan.Buffer buffer : plan.buffers) {
            if (buffer.name.equals(name)) {
                return Resources.held(buffer);
            }
        }
        throw new IllegalArgumentException("no buffer " + name);
    }

    private void setShared() {
        for (int program : resources.programs.values()) {
            GLES20.glUseProgram(program);
            for (Uniform uniform : plan.uniforms) {
                uniform.set(GLES20.glGetUniformLocation(program, uniform.name));
            }
            int tileSize = GLES20.glGetUniformLocation(program, "tile_size");
            if (tileSize >= 0) {
                GLES20.glUniform2i(tileSize, plan.tileWidth, plan.tileHeight);
            }
        }
    }

    private Step[] steps(boolean ofSetup) throws AgentException {
        List<Step> steps = new ArrayList<Step>();
        for (Plan.Pass pass : plan.passes) {
            if (pass.setup == ofSetup) {
                steps.add(new Step(plan, pass, resources));
            }
        }
        return steps.toArray(new Step[0]);
    }
}
