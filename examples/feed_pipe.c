/* Sends depth to kpopnet from a program in C or C++: put your camera where the wall is drawn.

       cc examples/feed_pipe.c -o feed_pipe && ./feed_pipe | kpopnet teach --live -

   What is sent: docs/predicting.md. A little-endian machine is assumed, as all usual ones are. */

#define _POSIX_C_SOURCE 199309L
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { WIDTH = 640, HEIGHT = 480 };
static uint16_t depth_mm[HEIGHT][WIDTH]; /* 0 where nothing was measured */

int main(int count, char **words) {
    const struct timespec pause = {0, 33000000};
    long images = count > 1 ? atol(words[1]) : -1; /* without a number: for ever */
    printf("{\"width\": %d, \"height\": %d, \"fx\": 570.3, \"fy\": 570.3, \"cx\": 319.5, \"cy\": 239.5, "
           "\"dtype\": \"uint16\", \"unit_m\": 0.001}\n", WIDTH, HEIGHT);
    for (long image = 0; image != images; image++) {
        struct timespec now;
        for (int row = 0; row < HEIGHT; row++)
            for (int column = 0; column < WIDTH; column++)
                depth_mm[row][column] = 2000 + column + image % 100; /* your camera: a slanted wall that moves */
        clock_gettime(CLOCK_MONOTONIC, &now);
        struct { double time_s; uint64_t bytes; } head = {now.tv_sec + 1e-9 * now.tv_nsec, sizeof depth_mm};
        if (fwrite(&head, sizeof head, 1, stdout) != 1 || fwrite(depth_mm, sizeof depth_mm, 1, stdout) != 1 || fflush(stdout))
            return 1; /* kpopnet has ended */
        nanosleep(&pause, NULL);
    }
    return 0;
}
