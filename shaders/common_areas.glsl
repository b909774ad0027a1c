#include "common_budget.glsl"

// Without `precise` a compiler may contract a product that it adds; one that has passed an unknown bit pattern it cannot.
#ifdef GL_EXT_gpu_shader5
#define ROUNDED(v) (v)
#else
#define ROUNDED(v) uintBitsToFloat(floatBitsToUint(v) ^ uvec3(budget_turns.x ^ budget_turns.y))
#endif

// What rounding `product`, the products of `x` and `y`, took off: Dekker 1971. Halves of 12 bits, cut off the bits so
// that no compiler can see through them, have exact products, so contracting these changes nothing.
vec3 product_errors(vec3 x, vec3 y, vec3 product) {
    PRECISE vec3 x_high = uintBitsToFloat(floatBitsToUint(x) & 0xfffff000u);
    PRECISE vec3 y_high = uintBitsToFloat(floatBitsToUint(y) & 0xfffff000u);
    PRECISE vec3 x_low = x - x_high;
    PRECISE vec3 y_low = y - y_high;
    PRECISE vec3 errors = ((x_high * y_high - product) + x_high * y_low + x_low * y_high) + x_low * y_low;
    return errors;
}

// Twice the signed areas of the triangles that the origin makes with the edges ca, ab and bc of three corners (x, y) in
// a plane, given as (U, V, W): of CB, AC and BA. Each sign is exact: the difference of two rounded products has the true
// sign or is 0, and if it is 0 what rounding took off them decides. Only products below 2^-78 may count as 0 too soon.
// Exchanging two corners exchanges signs to the last bit.
vec3 signed_areas(vec3 x, vec3 y) {
    PRECISE vec3 first = ROUNDED(x.zxy * y.yzx);
    PRECISE vec3 second = ROUNDED(x.yzx * y.zxy);
    PRECISE vec3 plain = first - second;
    PRECISE vec3 fine = product_errors(x.zxy, y.yzx, first) - product_errors(x.yzx, y.zxy, second);
    return mix(plain, fine, equal(plain, vec3(0.0)));
}
