// A group of 8x8 pixels, a block of them an invocation.
layout(local_size_x = PACKET_GROUP) in;
layout(rgba8, binding = 0) uniform writeonly highp image2D canvas;
uniform ivec2 group_origin;

void main() {
    const uint across = 8u / uint(PACKET_WIDTH);
    uvec2 block = uvec2(gl_LocalInvocationIndex % across, gl_LocalInvocationIndex / across);
    ivec2 corner = group_origin + ivec2(gl_WorkGroupID.xy * 8u + block * uvec2(PACKET_WIDTH, PACKET_HEIGHT));
    render_packet(corner);
    for (int k = 0; k < PACKET; k++) {
        ivec2 pixel = packet_pixel(corner, k);
        if (all(lessThan(pixel, image_size))) {
            imageStore(canvas, pixel, packet_shown[k]);
        }
    }
}
