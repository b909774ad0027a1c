package org.rayfarm.agent;

import java.io.File;
import java.io.FileInputStream;
import java.io.FileOutputStream;
import java.io.IOException;
import java.io.InputStream;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.security.MessageDigest;

/** The bytes of a result record, version 1 (README.md). */
final class RecordFile {
    private static final int VERSION = 1;
    private static final int CHUNK = 1 << 16;

    private RecordFile() {
    }

    /** Write and sync a record of a header and, unless null, a file of padded blobs. */
    static void write(File file, byte[] header, File blobs) throws IOException {
        MessageDigest digest = Digests.sha256();
        FileOutputStream out = new FileOutputStream(file);
        try {
            ByteBuffer head = ByteBuffer.allocate(16).order(ByteOrder.LITTLE_ENDIAN);
            head.put("RAYRSLT\0".getBytes("US-ASCII")).putInt(VERSION).putInt(header.length);
            append(out, digest, head.array(), 16);
            append(out, digest, header, header.length);
            if (blobs != null) {
                copy(blobs, out, digest);
            }
            out.write("RAYDONE\0".getBytes("US-ASCII"));
            out.write(digest.digest());
            out.getFD().sync();
        } finally {
            out.close();
        }
    }

    private static void copy(File from, FileOutputStream out, MessageDigest digest) throws IOException {
        InputStream in = new FileInputStream(from);
        try {
            byte[] chunk = new byte[CHUNK];
            for (int read = in.read(chunk); read >= 0; read = in.read(chunk)) {
                append(out, digest, chunk, read);
            }
        } finally {
            in.close();
        }
    }

    private static void append(FileOutputStream out, MessageDigest digest, byte[] bytes, int count)
            throws IOException {
        digest.update(bytes, 0, count);
        out.write(bytes, 0, count);
    }
}
