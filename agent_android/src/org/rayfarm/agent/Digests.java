package org.rayfarm.agent;

import java.io.UnsupportedEncodingException;
import java.nio.ByteBuffer;
import java.security.MessageDigest;
import java.security.NoSuchAlgorithmException;

/** sha256, in hex as plans and records have it. */
final class Digests {
    private static final String DIGITS = "0123456789abcdef";

    private Digests() {
    }

    static MessageDigest sha256() {
        try {
            return MessageDigest.getInstance("SHA-256");
        } catch (NoSuchAlgorithmException error) {
            throw new IllegalStateException(error);
        }
    }

    static String of(String text) {
        try {
            return hex(sha256().digest(text.getBytes("UTF-8")));
        } catch (UnsupportedEncodingException error) {
            throw new IllegalStateException(error);
        }
    }

    /** The sha256 of all bytes that remain; the buffer's position stays. */
    static String of(ByteBuffer bytes) {
        MessageDigest digest = sha256();
        digest.update(bytes.duplicate());
        return hex(digest.digest());
    }

    private static String hex(byte[] bytes) {
        StringBuilder text = new StringBuilder();
        for (byte value : bytes) {
            text.append(DIGITS.charAt(value >> 4 & 15)).append(DIGITS.charAt(value & 15));
        }
        return text.toString();
    }
}
