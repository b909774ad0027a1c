package org.rayfarm.agent;

/** The probe's shader texts: one function of an operation and a case, with all inputs in uniforms. */
final class PrecisionText {
    static final String VERTEX = ""
            + "#version 310 es\n"
            + "void main() {\n"
            + "    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);\n"
            + "    gl_Position = vec4(corner * 4.0 - 1.0, 0.0, 1.0);\n"
            + "}\n";

    private static final String COMMON = ""
            + "#version 310 es\n"
            + "#extension GL_EXT_gpu_shader5 : enable\n"
            + "precision highp float;\n"
            + "precision highp int;\n"
            + "#ifdef GL_EXT_gpu_shader5\n"
            + "#define PRECISE precise\n"
            + "#else\n"
            + "#define PRECISE\n"
            + "#endif\n"
            + "struct Hit { vec3 at; float t; uint id; };\n"
            + "uniform uvec4 cases[" + PrecisionCases.COUNT + "];\n"
            + "Hit nearer(Hit found, vec3 at, float t, uint id) {\n"
            + "    if (t < found.t) { found.at = at; found.t = t; found.id = id; }\n"
            + "    return found;\n"
            + "}\n"
            + "uint answer(int operation, int which) {\n"
            + "    uvec4 bits = cases[which];\n"
            + "    float a = uintBitsToFloat(bits.x);\n"
            + "    float b = uintBitsToFloat(bits.y);\n"
            + "    float c = uintBitsToFloat(bits.z);\n"
            + "    float tiny = uintBitsToFloat(bits.w);\n"
            + "    Hit hit = nearer(Hit(vec3(0.0), 1e30, 0u), vec3(a, b, a), abs(b), bits.x);\n"
            + "    switch (operation) {\n"
            + "    case 0: return floatBitsToUint(a + b);\n"
            + "    case 1: return floatBitsToUint(a * b);\n"
            + "    case 2: return floatBitsToUint(a / b);\n"
            + "    case 3: return floatBitsToUint(sqrt(abs(a)));\n"
            + "    case 4: { float sum = a * b + c; return floatBitsToUint(sum); }\n"
            + "    case 5: { PRECISE float sum = a * b + c; return floatBitsToUint(sum); }\n"
            + "    case 6: return uint(min(int(bits.x), int(bits.y)));\n"
            + "    case 7: return uint(max(int(bits.x), int(bits.y)));\n"
            + "    case 8: return bits.x * bits.y;\n"
            + "    case 9: return floatBitsToUint(tiny + tiny);\n"
            + "    case 10: return floatBitsToUint(hit.at.x);\n"
            + "    case 11: return floatBitsToUint(hit.t);\n"
            + "    default: return hit.id;\n"
            + "    }\n"
            + "}\n";

    private PrecisionText() {
    }

    static String compute() {
        return COMMON
                + "layout(local_size_x = 8) in;\n"
                + "layout(std430, binding = 0) writeonly buffer Answers { uint answers[]; };\n"
                + "void main() {\n"
                + "    ivec2 at = ivec2(gl_GlobalInvocationID.xy);\n"
                + "    answers[at.y * " + PrecisionCases.COUNT + " + at.x] = answer(at.y, at.x);\n"
                + "}\n";
    }

    static String fragment() {
        return COMMON
                + "layout(location = 0) out highp uint found;\n"
                + "void main() {\n"
                + "    ivec2 at = ivec2(gl_FragCoord.xy);\n"
                + "    found = answer(at.y, at.x);\n"
                + "}\n";
    }
}
