/* What the filter of README.md makes of the harness's samples: reference SAMPLES > values.
 * For each sample u and y, and after every hundredth theta, binary32 in this machine's order. */
#include "harness.h"

#include "wiring.h"

int main(int argc, char **argv)
{
    const uint32_t samples = argc > 1 ? (uint32_t)strtoul(argv[1], NULL, 10) : 0u;
    aeo_real_t z[INPUTS + OUTPUTS];
    uint32_t k;
    if (!identification_init()) {
        return 1;
    }
    for (k = 0; k < samples; k++) {
        harness_sensors(z, z + INPUTS);
        control_task(z, z + INPUTS, UINT64_C(100000) * k);
        (void)fwrite(z, sizeof *z, INPUTS + OUTPUTS, stdout);
        if (k % 100u == 99u) {
            (void)fwrite(aeo_estimator_theta(&estimator), sizeof *z, estimator.regressor.length * OUTPUTS, stdout);
        }
    }
    return fflush(stdout) == 0 ? 0 : 1;
}
