package org.rayfarm.agent;

import java.util.ArrayList;
import java.util.Iterator;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import org.json.JSONArray;
import org.json.JSONException;
import org.json.JSONObject;

/** A plan's header, as renderer/plan.py writes it: texts, buffers, passes. */
final class Plan {
    /** Compute passes run work groups of 8x8. */
    static final int GROUP = 8;

    final int width;
    final int height;
    final int tileWidth;
    final int tileHeight;
    final List<Buffer> buffers = new ArrayList<Buffer>();
    final Map<String, Texture> textures = new LinkedHashMap<String, Texture>();
    /** Texts by stage, by program. */
    final Map<String, Map<String, String>> programs = new LinkedHashMap<String, Map<String, String>>();
    final List<Pass> passes = new ArrayList<Pass>();
    final List<Uniform> uniforms;
    final String output;
    final Map<String, Long> needs = new LinkedHashMap<String, Long>();

    /** What fills a buffer or a texture: {@code bytes}; {@code offset} from the header's end, negative for scratch. */
    static final class Buffer {
        final String name;
        final String kind;
        final long bytes;
        final long offset;
        final String sha256;

        Buffer(JSONObject entry, String kind) throws JSONException {
            this.kind = kind;
            name = entry.getString("name");
            bytes = entry.getLong("bytes");
            offset = entry.isNull("offset") ? -1 : entry.getLong("offset");
            sha256 = entry.optString("sha256");
        }
    }

    /** A texture: rgba8, r32ui or depth24 of the image's size, or rgba32ui that holds data. */
    static final class Texture {
        static final int TEXEL_BYTES = 16;

        final String format;
        final int width;
        /** The words that fill its texels row by row; null for a texture that the device fills. */
        final Buffer data;

        Texture(JSONObject entry) throws JSONException {
            format = entry.getString("format");
            data = entry.isNull("offset") ? null : new Buffer(entry, "texture");
            width = data == null ? 0 : entry.getInt("width");
        }

        /** The rows of its data, the last of which need not be full. */
        long rows() {
            long row = (long) width * TEXEL_BYTES;
            return Math.max((data.bytes + row - 1) / row, 1);
        }
    }

    /** One step of a frame; names are those of the plan's programs, buffers and textures. */
    static final class Pass {
        final String name;
        final String kind;
        final String program;
        final boolean setup;
        final Map<Integer, String> storage;
        final Map<String, String> textures;
        final Map<Integer, String> images;
        final List<String> target = new ArrayList<String>();
        final String vertices;
        final List<Uniform> uniforms;
        final String collect;

        Pass(JSONObject entry) throws JSONException {
            name = entry.getString("name");
            kind = entry.getString("kind");
            program = entry.getString("program");
            setup = entry.getString("phase").equals("setup");
            storage = numbered(entry.getJSONObject("storage"));
            textures = strings(entry.getJSONObject("textures"));
            images = numbered(entry.getJSONObject("images"));
            JSONArray names = entry.getJSONArray("target");
            for (int i = 0; i < names.length(); i++) {
                target.add(names.getString(i));
            }
            vertices = entry.isNull("vertices") ? null : entry.getString("vertices");
            uniforms = Uniform.all(entry.getJSONObject("uniforms"));
            collect = entry.isNull("collect") ? null : entry.getString("collect");
        }
    }

    /** Read a header; the texts' checksums are checked. */
    Plan(JSONObject header) throws JSONException, AgentException {
        width = header.getJSONArray("size").getInt(0);
        height = header.getJSONArray("size").getInt(1);
        tileWidth = header.getJSONArray("tile").getInt(0);
        tileHeight = header.getJSONArray("tile").getInt(1);
        for (JSONObject entry : objects(header.getJSONArray("buffers"))) {
            buffers.add(new Buffer(entry, "buffer"));
        }
        for (JSONObject entry : objects(header.getJSONArray("textures"))) {
            textures.put(entry.getString("name"), new Texture(entry));
        }
        for (JSONObject entry : objects(header.getJSONArray("programs"))) {
            programs.put(entry.getString("name"), texts(entry));
        }
        for (JSONObject entry : objects(header.getJSONArray("passes"))) {
            passes.add(new Pass(entry));
        }
        uniforms = Uniform.all(header.getJSONObject("uniforms"));
        output = header.getString("output");
        JSONObject limits = header.getJSONObject("needs");
        for (Iterator<String> names = limits.keys(); names.hasNext();) {
            String name = names.next();
            needs.put(name, limits.getLong(name));
        }
    }

    /** Whether any pass reads buffers back. */
    boolean collects() {
        for (Pass pass : passes) {
            if (pass.collect != null) {
                return true;
            }
        }
        return false;
    }

    private static Map<String, String> texts(JSONObject program) throws JSONException, AgentException {
        Map<String, String> texts = strings(program.getJSONObject("stages"));
        Map<String, String> digests = strings(program.getJSONObject("sha256"));
        for (Map.Entry<String, String> stage : texts.entrySet()) {
            if (!Digests.of(stage.getValue()).equals(digests.get(stage.getKey()))) {
                throw AgentException.failed("The plan's program " + program.getString("name")
                        + " fails its checksum: the file is torn.");
            }
        }
        return texts;
    }

    private static List<JSONObject> objects(JSONArray array) throws JSONException {
        List<JSONObject> objects = new ArrayList<JSONObject>();
        for (int i = 0; i < array.length(); i++) {
            objects.add(array.getJSONObject(i));
        }
        return objects;
    }

    private static Map<String, String> strings(JSONObject object) throws JSONException {
        Map<String, String> strings = new LinkedHashMap<String, String>();
        for (Iterator<String> names = object.keys(); names.hasNext();) {
            String name = names.next();
            strings.put(name, object.getString(name));
        }
        return strings;
    }

    private static Map<Integer, String> numbered(JSONObject object) throws JSONException {
        Map<Integer, String> numbered = new LinkedHashMap<Integer, String>();
        for (Map.Entry<String, String> entry : strings(object).entrySet()) {
            numbered.put(Integer.valueOf(entry.getKey()), entry.getValue());
        }
        return numbered;
    }
}
