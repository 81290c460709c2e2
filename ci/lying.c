/* Says that its buffer is longer than it is: for ci/sanitizers, which must find that out. */
#include "pitchleak.h"
#include <stdlib.h>

int main(void)
{
    static const PitchleakRig rig = {
        {12.6e-4f, 9.4e-4f, 0.2f, 20.0f, 50e-6f, 50e-6f},
        {0.8e9f, 0.2e9f},
        {1e-6f, 0.0f, 0.0f, 0.0f},
        {1e-6f, 0.0f, 0.0f, 0.0f},
        {53e3f, 0.0f, 0.0f, 0.0f},
        {0.667e-3f, 0.0f, 0.0f, 0.0f},
        1e-6f, 1e-6f, 1e-6f,
        0.5f,
    };
    static Pitchleak4 estimator;
    size_t length = PITCHLEAK4_STATE_BYTES;
    uint8_t *state = malloc(64);

    if (pitchleak4_begin(&estimator, &rig) < 0 || pitchleak4_save(&estimator, state, &length) < 0)
        return 0;
    free(state);
    return 0;
}
