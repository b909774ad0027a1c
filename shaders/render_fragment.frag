layout(location = 0) out vec4 colour;

void main() {
    colour = render_pixel(ivec2(gl_FragCoord.xy));
}
