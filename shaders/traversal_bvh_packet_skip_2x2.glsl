// Blocks of 2x2 pixels share an invocation (`common_packet_skip.glsl`).
#define PACKET_WIDTH 2
#define PACKET_HEIGHT 2
#define PACKET_GROUP 16
#include "common_packet_skip.glsl"
