// The second step of the compute method (paper section 3.3): draw the image that the first one wrote.
uniform highp sampler2D canvas;
layout(location = 0) out vec4 colour;

void main() {
    colour = texelFetch(canvas, ivec2(gl_FragCoord.xy), 0);
}
