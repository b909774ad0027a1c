// Blocks of 4x2 pixels share an invocation and, where their rays run alike, box tests (`common_packet_interval.glsl`).
#define PACKET_WIDTH 4
#define PACKET_HEIGHT 2
#define PACKET_GROUP 8
#define PACKET_INTERVAL 1
#include "common_packet_stack.glsl"
