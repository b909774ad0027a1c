package org.rayfarm.agent;

import android.opengl.GLES20;
import android.opengl.GLES30;
import android.opengl.GLES31;
import java.util.ArrayList;
import java.util.List;
import java.util.Map;

/** A pass made ready: all names resolved, so that running it looks nothing up and allocates nothing. */
final class Step {
    private static final int CORNER_BYTES = 16;
    private static final int[] NO_COLOUR_UINT = new int[4];
    private static final float[] NO_COLOUR = new float[4];
    private static final float[] FAR = {1};

    final Plan.Pass pass;
    private final Plan plan;
    private final int program;
    private final int framebuffer;
    private final int vertexArray;
    private final int corners;
    private final boolean unsignedColour;
    private final boolean tiled;
    private final int[] bindings;
    private final int[] buffers;
    private final int[] samplers;
    private final int[] sampled;
    private final int[] units;
    private final int[] images;
    private final int[] accesses;
    private final int[] formats;
    private final Uniform[] uniforms;
    private final int[] locations;
    private final int tileOrigin;
    private final int groupOrigin;

    Step(Plan plan, Plan.Pass pass, Resources resources) throws AgentException {
        this.plan = plan;
        this.pass = pass;
        program = resources.programs.get(pass.program);
        framebuffer = pass.target.isEmpty() ? 0 : resources.framebuffer(pass.target);
        unsignedColour = !pass.target.isEmpty() && plan.textures.get(pass.target.get(0)).format.equals("r32ui");
        tiled = plan.width > plan.tileWidth || plan.height > plan.tileHeight;
        bindings = numbers(pass.storage);
        buffers = named(pass.storage.values(), resources.buffers);
        samplers = locations(pass.textures);
        sampled = named(pass.textures.values(), resources.textures);
        units = numbers(pass.images);
        images = named(pass.images.values(), resources.textures);
        accesses = new int[units.length];
        formats = new int[units.length];
        int image = 0;
        for (String name : pass.images.values()) {
            Plan.Texture texture = plan.textures.get(name);
            accesses[image] = texture.data == null ? GLES31.GL_WRITE_ONLY : GLES31.GL_READ_ONLY;
            formats[image++] = Resources.internalFormat(texture.format);
        }
        uniforms = pass.uniforms.toArray(new Uniform[0]);
        locations = new int[uniforms.length];
        for (int i = 0; i < uniforms.length; i++) {
            locations[i] = location(uniforms[i].name);
        }
        tileOrigin = location("tile_origin");
        groupOrigin = location("group_origin");
        corners = pass.vertices == null ? 0 : vertexCount(plan.buffers, pass.vertices);
        vertexArray = pass.kind.equals("compute") ? 0 : vertexArray(resources);
    }

    /** Run the pass over all tiles; after each, hand the tile to the collector, which may be null. */
    void run(Collector collector) throws Exception {
        bind();
        if (pass.kind.equals("raster")) {
            raster();
        } else {
            for (int y = 0; y < plan.height; y += plan.tileHeight) {
                for (int x = 0; x < plan.width; x += plan.tileWidth) {
                    int width = Math.min(plan.tileWidth, plan.width - x);
                    int height = Math.min(plan.tileHeight, plan.height - y);
                    submit(x, y, width, height);
                    if (tiled) {
                        // A tiling GPU would gather the draws into one submission, and its watchdog end it.
                        GLES20.glFlush();
                    }
                    if (collector != null && pass.collect != null) {
                        GLES31.glMemoryBarrier(GLES31.GL_ALL_BARRIER_BITS);
                        collector.collect(pass.collect, x, y, width, height);
                    }
                }
            }
        }
        GLES31.glMemoryBarrier(GLES31.GL_ALL_BARRIER_BITS);
    }

    private void bind() {
        GLES20.glUseProgram(program);
        for (int i = 0; i < bindings.length; i++) {
            GLES30.glBindBufferBase(GLES31.GL_SHADER_STORAGE_BUFFER, bindings[i], buffers[i]);
        }
        for (int unit = 0; unit < samplers.length; unit++) {
            GLES20.glActiveTexture(GLES20.GL_TEXTURE0 + unit);
            GLES20.glBindTexture(GLES20.GL_TEXTURE_2D, sampled[unit]);
            if (samplers[unit] >= 0) {
                GLES20.glUniform1i(samplers[unit], unit);
            }
        }
        for (int i = 0; i < units.length; i++) {
            GLES31.glBindImageTexture(units[i], images[i], 0, false, 0, accesses[i], formats[i]);
        }
        for (int i = 0; i < uniforms.length; i++) {
            uniforms[i].set(locations[i]);
        }
        if (vertexArray != 0) {
            GLES30.glBindVertexArray(vertexArray);
            GLES20.glBindFramebuffer(GLES20.GL_FRAMEBUFFER, framebuffer);
            GLES20.glViewport(0, 0, plan.width, plan.height);
        }
    }

    private void submit(int x, int y, int width, int height) {
        if (tileOrigin >= 0) {
            GLES20.glUniform2i(tileOrigin, x, y);
        }
        if (vertexArray == 0) {
            if (groupOrigin >= 0) {
                GLES20.glUniform2i(groupOrigin, x, y);
            }
            int across = (width + Plan.GROUP - 1) / Plan.GROUP;
            GLES31.glDispatchCompute(across, (height + Plan.GROUP - 1) / Plan.GROUP, 1);
            return;
        }
        GLES20.glEnable(GLES20.GL_SCISSOR_TEST);
        GLES20.glScissor(x, y, width, height);
        GLES20.glDrawArrays(GLES20.GL_TRIANGLE_STRIP, 0, 4);
        GLES20.glDisable(GLES20.GL_SCISSOR_TEST);
    }

    private void raster() {
        // glClear leaves an integer colour undefined.
        if (unsignedColour) {
            GLES30.glClearBufferuiv(GLES30.GL_COLOR, 0, NO_COLOUR_UINT, 0);
        } else {
            GLES30.glClearBufferfv(GLES30.GL_COLOR, 0, NO_COLOUR, 0);
        }
        if (pass.target.size() > 1) {
            GLES30.glClearBufferfv(GLES30.GL_DEPTH, 0, FAR, 0);
        }
        GLES20.glEnable(GLES20.GL_DEPTH_TEST);
        GLES20.glDrawArrays(GLES20.GL_TRIANGLES, 0, corners);
        GLES20.glDisable(GLES20.GL_DEPTH_TEST);
    }

    private int vertexArray(Resources resources) {
        int[] made = new int[1];
        GLES30.glGenVertexArrays(1, made, 0);
        if (pass.vertices == null) {
            return made[0];
        }
        GLES30.glBindVertexArray(made[0]);
        GLES20.glBindBuffer(GLES20.GL_ARRAY_BUFFER, resources.buffers.get(pass.vertices));
        int position = GLES20.glGetAttribLocation(program, "position");
        int normal = GLES20.glGetAttribLocation(program, "normal");
        if (position >= 0) {
            GLES20.glEnableVertexAttribArray(position);
            GLES20.glVertexAttribPointer(position, 3, GLES20.GL_FLOAT, false, CORNER_BYTES, 0);
        }
        if (normal >= 0) {
            GLES20.glEnableVertexAttribArray(normal);
            GLES30.glVertexAttribIPointer(normal, 1, GLES20.GL_UNSIGNED_INT, CORNER_BYTES, 12);
        }
        GLES30.glBindVertexArray(0);
        return made[0];
    }

    private int location(String name) {
        return GLES20.glGetUniformLocation(program, name);
    }

    private int[] locations(Map<String, String> samplers) {
        int[] found = new int[samplers.size()];
        int i = 0;
        for (String sampler : samplers.keySet()) {
            found[i++] = location(sampler);
        }
        return found;
    }

    private static int vertexCount(List<Plan.Buffer> buffers, String name) {
        for (Plan.Buffer buffer : buffers) {
            if (buffer.name.equals(name)) {
                return (int) (buffer.bytes / CORNER_BYTES);
            }
        }
        return 0;
    }

    private static int[] numbers(Map<Integer, String> map) {
        int[] numbers = new int[map.size()];
        int i = 0;
        for (int key : map.keySet()) {
            numbers[i++] = key;
        }
        return numbers;
    }

    private static int[] named(Iterable<String> names, Map<String, Integer> made) throws AgentException {
        List<Integer> found = new ArrayList<Integer>();
        for (String name : names) {
            if (!made.containsKey(name)) {
                throw AgentException.failed("The plan names '" + name + "' and has nothing of that name.");
            }
            found.add(made.get(name));
        }
        int[] numbers = new int[found.size()];
        for (int i = 0; i < numbers.length; i++) {
            numbers[i] = found.get(i);
        }
        return numbers;
    }
}
