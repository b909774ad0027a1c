package org.rayfarm.agent;

import android.opengl.GLES20;
import android.opengl.GLES30;
import android.os.Build;
import java.util.Map;
import java.util.Set;
import java.util.TreeSet;
import org.json.JSONArray;
import org.json.JSONException;
import org.json.JSONObject;

/** What the current context and Android say of the device. */
final class Device {
    final Limits limits;
    private final Set<String> extensions = new TreeSet<String>();
    private final JSONObject json = new JSONObject();

    Device(GlContext context) throws JSONException {
        int[] count = new int[1];
        GLES20.glGetIntegerv(GLES30.GL_NUM_EXTENSIONS, count, 0);
        for (int i = 0; i < count[0]; i++) {
            extensions.add(GLES30.glGetStringi(GLES20.GL_EXTENSIONS, i));
        }
        limits = new Limits();
        json.put("gl_vendor", GLES20.glGetString(GLES20.GL_VENDOR));
        json.put("gl_renderer", GLES20.glGetString(GLES20.GL_RENDERER));
        json.put("gl_version", GLES20.glGetString(GLES20.GL_VERSION));
        json.put("glsl_version", GLES20.glGetString(GLES20.GL_SHADING_LANGUAGE_VERSION));
        json.put("egl_version", context.version());
        json.put("extensions", new JSONArray(extensions));
        JSONObject offered = new JSONObject();
        for (Map.Entry<String, Long> limit : limits.offered().entrySet()) {
            offered.put(limit.getKey(), limit.getValue().longValue());
        }
        json.put("limits", offered);
        json.put("android", android());
    }

    boolean has(String extension) {
        return extensions.contains(extension);
    }

    /** The record's `device`; a probe adds to it. */
    JSONObject json() {
        return json;
    }

    private static JSONObject android() throws JSONException {
        JSONObject about = new JSONObject();
        about.put("release", Build.VERSION.RELEASE).put("sdk", Build.VERSION.SDK_INT);
        about.put("manufacturer", Build.MANUFACTURER).put("model", Build.MODEL).put("device", Build.DEVICE);
        about.put("board", Build.BOARD).put("hardware", Build.HARDWARE).put("fingerprint", Build.FINGERPRINT);
        about.put("soc_manufacturer", since31("SOC_MANUFACTURER")).put("soc_model", since31("SOC_MODEL"));
        return about;
    }

    /** A field that Build has from API level 31 on; JSON's null before. */
    private static Object since31(String field) {
        try {
            return Build.class.getField(field).get(null);
        } catch (ReflectiveOperationException error) {
            return JSONObject.NULL;
        }
    }
}
