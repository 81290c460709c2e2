/* Leaks of a pitch cylinder from C. Reads rows `dt_s x_m pa_pa pb_pa qa_m3s qb_m3s` (`nan` where a flow is not
   measured) from standard input, prints what it finds.

     cargo build --release -p pitchleak-c
     cc -std=c11 -Icrates/pitchleak-c/include crates/pitchleak-c/examples/leaks.c target/release/libpitchleak_c.a -lm -o leaks */
#include "pitchleak.h"
#include <stdio.h>

#define LPM (1e-3f / 60.0f) /* m3/s */

static const PitchleakRig rig = {
    {12.6e-4f, 9.4e-4f, 0.2f, 20.0f, 50e-6f, 50e-6f}, /* areas, stroke, mass, dead volumes */
    {0.8e9f, 0.2e9f},                                 /* bulk modulus, and how well it is known */
    {0.0667f * LPM, 0.0f, 0.0f, 0.0f},                /* flow meter A: noise, offset, gain, drift an hour, 1 sigma each */
    {0.0667f * LPM, 0.0f, 0.0f, 0.0f},                /* flow meter B */
    {53e3f, 0.0f, 0.0f, 0.0f},                        /* pressures */
    {0.667e-3f, 0.0f, 0.0f, 0.0f},                    /* position */
    0.1f * LPM, 0.1f * LPM, 0.1f * LPM,               /* alarms */
    0.5f,                                             /* a longer step is a gap */
};

int main(void)
{
    static Pitchleak4 estimator; /* no allocation: it stands where you put it */
    static uint8_t state[PITCHLEAK4_STATE_BYTES];
    size_t length = sizeof state;
    PitchleakSample sample;
    PitchleakFound found;
    float dt_s;

    if (pitchleak4_begin(&estimator, &rig) < 0)
        return 2;
    while (scanf("%f %f %f %f %f %f", &dt_s, &sample.x_m, &sample.pa_pa, &sample.pb_pa, &sample.qa_m3s,
                 &sample.qb_m3s) == 6) {
        PitchleakResult result = pitchleak4_update(&estimator, dt_s, &sample);
        if (result < 0)
            return 2;
        if (result == PITCHLEAK_RESULT_RENEWED || result == PITCHLEAK_RESULT_CHANGED) {
            pitchleak4_find(&estimator, &found);
            printf("%.9g %.9g %.9g %.9g %.9g %.9g %d\n", found.internal_m3s.value, found.internal_m3s.std,
                   found.external_a_m3s.value, found.external_a_m3s.std, found.external_b_m3s.value,
                   found.external_b_m3s.std, found.alarms.internal);
            /* What a restart goes on from: keep it where it survives, take it back with restore. */
            length = sizeof state;
            if (pitchleak4_save(&estimator, state, &length) < 0 ||
                pitchleak4_restore(&estimator, state, length) < 0)
                return 2;
        }
    }
    return 0;
}
