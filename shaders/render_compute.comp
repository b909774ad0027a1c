layout(local_size_x = 8, local_size_y = 8) in;
layout(rgba8, binding = 0) uniform writeonly highp image2D canvas;
uniform ivec2 group_origin;

void main() {
    // Eight invocations that follow one another cover 4x2 pixels, as the fragments of a draw do: they part less often
    // than 8x1 would.
    uint i = gl_LocalInvocationIndex;
    uvec2 local = uvec2((i & 3u) | ((i >> 1) & 4u), ((i >> 2) & 1u) | ((i >> 3) & 6u));
    ivec2 pixel = group_origin + ivec2(gl_WorkGroupID.xy * 8u + local);
    if (all(lessThan(pixel, image_size))) {
        imageStore(canvas, pixel, render_pixel(pixel));
    }
}
