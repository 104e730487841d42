/* Call the block as a simulation does: y_k = 0.5 u_{k-1} - 0.25 y_{k-1}; its parameters must foretell the next sample. */
#include "aeolid_block.h"

#include <stdio.h>
#include <string.h>

int main(void)
{
    double u[1] = {0}, y[1] = {0}, innovation[1] = {0}, markov[BLOCK_PARAMETERS] = {0};
    double window[BLOCK_PARAMETERS] = {0}, foretold = 0;
    if (aeolid_block_start() != 0) {
        return 1;
    }
    for (unsigned k = 0; k < 2000; k++) {
        y[0] = 0.5 * u[0] - 0.25 * y[0];
        u[0] = (double)(k * k * k % 31u) / 15.0 - 1.0;
        if (aeolid_block_step(u, y, 0.1 * k, innovation, markov) < 0) {
            return 2;
        }
        memmove(window, window + 2, sizeof window - 2 * sizeof *window); /* oldest block first, u before y */
        window[BLOCK_PARAMETERS - 2] = u[0];
        window[BLOCK_PARAMETERS - 1] = y[0];
    }
    for (int j = 0; j < BLOCK_PARAMETERS; j++) {
        foretold += markov[j] * window[j];
    }
    const double error = foretold - (0.5 * u[0] - 0.25 * y[0]);
    printf("block: foretold within %s\n", error * error < 1e-6 ? "0.001" : "more");
    return error * error < 1e-6 && innovation[0] * innovation[0] < 1e-6 ? 0 : 3;
}
