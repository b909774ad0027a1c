package org.rayfarm.agent;

import java.util.Random;
import org.json.JSONException;
import org.json.JSONObject;

/** The probe's inputs, the answers that IEEE 754 single precision gives, and how far a device's are from them. */
final class PrecisionCases {
    /** Cases of each operation, a multiple of 8; their uniforms fit into ES 3.1's least number of vectors. */
    static final int COUNT = 64;

    /** In the order of PrecisionText's switch. `mul_add` may be contracted; `mul_add_precise` may not. */
    static final String[] OPERATIONS = {
        "add", "mul", "div", "sqrt", "mul_add", "mul_add_precise", "min_int", "max_int", "mul_int", "denormal",
        "struct_vector", "struct_float", "struct_uint"
    };

    private static final int FIRST_INTEGER = 6;
    private static final int DENORMAL = 9;
    private static final long SEED = 20240229;

    private final int[] words = new int[COUNT * 4];

    PrecisionCases() {
        Random random = new Random(SEED);
        for (int i = 0; i < COUNT; i++) {
            float a = some(random);
            float b = some(random);
            // The rounding error of a * b is what a contracted a * b + c would leave.
            float c = -(a * b);
            words[4 * i] = Float.floatToRawIntBits(a);
            words[4 * i + 1] = Float.floatToRawIntBits(b);
            words[4 * i + 2] = Float.floatToRawIntBits(c);
            words[4 * i + 3] = 1 + random.nextInt(1 << 21);
        }
    }

    /** Four words a case: a, b, -(a * b) and a denormal, as bits of floats. */
    int[] words() {
        return words;
    }

    /** By operation: cases, how many answers are wrong, and the most units in the last place of those of floats. */
    JSONObject judge(int[] answers) throws JSONException {
        JSONObject all = new JSONObject();
        for (int operation = 0; operation < OPERATIONS.length; operation++) {
            int wrong = 0;
            long most = 0;
            for (int i = 0; i < COUNT; i++) {
                int answer = answers[operation * COUNT + i];
                int right = right(operation, i);
                if (answer != right) {
                    wrong++;
                    most = Math.max(most, Math.abs(ordered(answer) - ordered(right)));
                }
            }
            boolean integer = operation >= FIRST_INTEGER && operation < DENORMAL;
            JSONObject found = new JSONObject().put("cases", COUNT).put("wrong", wrong);
            all.put(OPERATIONS[operation], found.put("max_ulp", integer ? JSONObject.NULL : (Object) most));
        }
        return all;
    }

    private int right(int operation, int i) {
        int first = words[4 * i];
        int second = words[4 * i + 1];
        float a = Float.intBitsToFloat(first);
        float b = Float.intBitsToFloat(second);
        switch (operation) {
            case 0:
                return Float.floatToRawIntBits(a + b);
            case 1:
                return Float.floatToRawIntBits(a * b);
            case 2:
                return Float.floatToRawIntBits(a / b);
            case 3:
                return Float.floatToRawIntBits((float) Math.sqrt(Math.abs(a)));
            case 4:
            case 5:
                return 0;
            case 6:
                return Math.min(first, second);
            case 7:
                return Math.max(first, second);
            case 8:
                return first * second;
            case 9:
                return words[4 * i + 3] * 2;
            case 11:
                return Float.floatToRawIntBits(Math.abs(b));
            default:
                return first;
        }
    }

    /** Either sign, exponents of -20 to 20, all bits of the fraction in use. */
    private static float some(Random random) {
        int sign = random.nextInt(2) << 31;
        int exponent = 107 + random.nextInt(41);
        return Float.intBitsToFloat(sign | exponent << 23 | random.nextInt(1 << 23));
    }

    /** Neighbouring floats are neighbouring numbers. */
    private static long ordered(int bits) {
        return bits < 0 ? Integer.MIN_VALUE - (long) bits : bits;
    }
}
