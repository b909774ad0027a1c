// Blocks of 2x2 pixels share an invocation (`common_packet_stack.glsl`).
#define PACKET_WIDTH 2
#define PACKET_HEIGHT 2
#define PACKET_GROUP 16
#define PACKET_INTERVAL 0
#include "common_packet_stack.glsl"
