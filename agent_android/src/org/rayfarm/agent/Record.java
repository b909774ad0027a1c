package org.rayfarm.agent;

import java.io.File;
import java.io.IOException;
import java.util.concurrent.atomic.AtomicBoolean;
import org.json.JSONArray;
import org.json.JSONException;
import org.json.JSONObject;

/** What a run found out so far, and its one writing: by the run's end or by the deadline, whichever comes first. */
final class Record {
    private final File out;
    private final JSONObject header = new JSONObject();
    private final AtomicBoolean ended = new AtomicBoolean();
    private final Blobs blobs;
    private volatile Frames frames;
    private volatile Samples samples;

    Record(String token, File out) {
        this.out = out;
        blobs = new Blobs(new File(out.getPath() + ".blobs"));
        put("token", token);
        put("agent", Version.VERSION);
    }

    void put(String name, Object value) {
        synchronized (header) {
            try {
                header.put(name, value);
            } catch (JSONException error) {
                throw new IllegalArgumentException(error);
            }
        }
    }

    void put(Frames measured, Samples read) {
        frames = measured;
        samples = read;
    }

    Blobs blobs() {
        return blobs;
    }

    /** Remove what an earlier run of the same name left. */
    void clear() {
        blobs.remove();
        temporary().delete();
        out.delete();
    }

    /** Remove what this run wrote; nothing is written afterwards. */
    void abandon() {
        claim();
        blobs.remove();
        temporary().delete();
    }

    /** Become the one that writes the record; false if another thread is. */
    boolean claim() {
        return ended.compareAndSet(false, true);
    }

    /** Write the record, having claimed it; false if it cannot be written. */
    boolean write(String outcome, String reason) {
        try {
            return written(outcome, reason, outcome.equals(AgentException.DONE));
        } catch (Exception error) {
            error.printStackTrace();
            return writtenWithout("The record could not be written: " + error + ".");
        } finally {
            blobs.remove();
        }
    }

    private boolean writtenWithout(String reason) {
        try {
            return written(AgentException.FAILED, reason, false);
        } catch (Exception error) {
            error.printStackTrace();
            return false;
        }
    }

    private boolean written(String outcome, String reason, boolean withBlobs) throws IOException, JSONException {
        byte[] text;
        synchronized (header) {
            header.put("outcome", outcome);
            header.put("reason", reason == null ? JSONObject.NULL : reason);
            header.put("frames", frames == null ? new JSONArray() : frames.json());
            header.put("samples", samples == null ? new JSONObject() : samples.json());
            header.put("unavailable", samples == null ? new JSONObject() : samples.unavailable());
            header.put("blobs", withBlobs ? blobs.json() : new JSONArray());
            text = header.toString().getBytes("UTF-8");
        }
        File part = temporary();
        RecordFile.write(part, text, withBlobs ? blobs.file() : null);
        if (!part.renameTo(out)) {
            throw new IOException("cannot rename " + part.getName());
        }
        return true;
    }

    private File temporary() {
        return new File(out.getPath() + ".part");
    }
}
