package org.rayfarm.agent;

import android.opengl.GLES20;
import android.opengl.GLES30;
import java.util.ArrayList;
import java.util.Iterator;
import java.util.List;
import org.json.JSONArray;
import org.json.JSONException;
import org.json.JSONObject;

/** A uniform's value, flat: more values than its type has are an array. Setting it allocates nothing. */
final class Uniform {
    final String name;
    private final String type;
    private final float[] floats;
    private final int[] ints;

    Uniform(String name, String type, JSONArray values) throws JSONException {
        this.name = name;
        this.type = type;
        boolean real = type.equals("float") || type.equals("vec2") || type.equals("vec3") || type.equals("mat4");
        floats = new float[real ? values.length() : 0];
        ints = new int[real ? 0 : values.length()];
        for (int i = 0; i < values.length(); i++) {
            if (real) {
                floats[i] = (float) values.getDouble(i);
            } else {
                ints[i] = (int) values.getLong(i);
            }
        }
    }

    /** All uniforms of a plan or a pass. */
    static List<Uniform> all(JSONObject entries) throws JSONException {
        List<Uniform> all = new ArrayList<Uniform>();
        for (Iterator<String> names = entries.keys(); names.hasNext();) {
            String name = names.next();
            JSONArray entry = entries.getJSONArray(name);
            all.add(new Uniform(name, entry.getString(0), entry.getJSONArray(1)));
        }
        return all;
    }

    /** Set it on the program in use; a location of -1 is a uniform that the compiler dropped. */
    void set(int location) {
        if (location < 0) {
            return;
        }
        switch (type) {
            case "int":
                GLES20.glUniform1iv(location, ints.length, ints, 0);
                break;
            case "uint":
                GLES30.glUniform1uiv(location, ints.length, ints, 0);
                break;
            case "ivec2":
                GLES20.glUniform2iv(location, ints.length / 2, ints, 0);
                break;
            case "uvec2":
                GLES30.glUniform2uiv(location, ints.length / 2, ints, 0);
                break;
            case "float":
                GLES20.glUniform1fv(location, floats.length, floats, 0);
                break;
            case "vec2":
                GLES20.glUniform2fv(location, floats.length / 2, floats, 0);
                break;
            case "vec3":
                GLES20.glUniform3fv(location, floats.length / 3, floats, 0);
                break;
            case "mat4":
                GLES20.glUniformMatrix4fv(location, floats.length / 16, false, floats, 0);
                break;
            default:
                throw new IllegalArgumentException("no uniform type " + type);
        }
    }
}
