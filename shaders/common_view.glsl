// The pinhole camera and the pixel a ray belongs to, from the pixel's integer position so that all methods agree.
uniform ivec2 image_size;
uniform vec2 pixel_step;    // 2 / image_size
uniform vec3 eye;
uniform vec3 view_forward;  // unit
uniform vec3 view_right;    // half the width of the image plane at distance 1
uniform vec3 view_up;       // half its height

vec3 view_direction(ivec2 pixel) {
    PRECISE vec2 plane = (vec2(pixel) + 0.5) * pixel_step - 1.0;
    PRECISE vec3 direction = view_forward + plane.x * view_right + plane.y * view_up;
    PRECISE vec3 unit = direction * inversesqrt(dot(direction, direction));
    return unit;
}
