// Blocks of 4x2 pixels share an invocation (`common_packet_skip.glsl`).
#define PACKET_WIDTH 4
#define PACKET_HEIGHT 2
#define PACKET_GROUP 8
#include "common_packet_skip.glsl"
