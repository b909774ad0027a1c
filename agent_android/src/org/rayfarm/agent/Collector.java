package org.rayfarm.agent;

/** Takes what a pass collects. */
interface Collector {
    /** Called after each tile with the buffer's name and the tile's rectangle in pixels. */
    void collect(String buffer, int x, int y, int width, int height) throws Exception;
}
