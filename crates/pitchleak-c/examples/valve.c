/* Leaks of a pitch cylinder without flow meters, by its calibrated valve. Reads the numbers of `mean` and `covariance`
   of valve.toml from standard input, then rows `dt_s x_m pa_pa pb_pa spool ps_pa`; prints what it finds.

     cc -std=c11 -Icrates/pitchleak-c/include crates/pitchleak-c/examples/valve.c target/release/libpitchleak_c.a -lm -o valve
     sed -n 's/^\(mean\|covariance\) = //p' valve.toml | tr '[],' '   ' | cat - rows.txt | ./valve */
#include "pitchleak.h"
#include <stdio.h>

#define LPM (1e-3f / 60.0f) /* m3/s */

static PitchleakValveRig rig = {
    {12.6e-4f, 9.4e-4f, 0.2f, 60.0f, 50e-6f, 50e-6f}, /* areas, stroke, mass, dead volumes */
    {0.8e9f, 0.2e9f},                                 /* bulk modulus, and how well it is known */
    {0.0f},                                           /* mean and */
    {0.0f},                                           /* covariance: read below; a controller has them as constants */
    4.0f * LPM, 35e5f,                                /* rated flow, and the drop at which it holds */
    2e5f,                                             /* tank */
    0.003f, 0.02f,                                    /* hysteresis, leakage at the middle */
    0.03f, 0.001f, 0.1f,                              /* drift of gains, overlaps, leakage */
    0.2e-3f, 16e3f, 1e-3f, 16e3f,                     /* noise of position, pressures, spool, supply pressure */
    0.1f * LPM, 0.1f * LPM, 0.1f * LPM,               /* alarms */
    0.5f,                                             /* a longer step is a gap */
};

static int read_all(float *numbers, int count)
{
    for (int i = 0; i < count; i++)
        if (scanf("%f", &numbers[i]) != 1)
            return 0;
    return 1;
}

int main(void)
{
    static PitchleakValve estimator; /* no allocation: it stands where you put it */
    static uint8_t state[PITCHLEAK_VALVE_STATE_BYTES];
    size_t length = sizeof state;
    PitchleakValveSample sample;
    PitchleakValveFound found;
    float dt_s;

    if (!read_all(rig.mean, PITCHLEAK_VALVE_UNKNOWNS) || !read_all(rig.covariance, PITCHLEAK_VALVE_COVARIANCES))
        return 2;
    if (pitchleak_valve_begin(&estimator, &rig) < 0)
        return 2;
    while (scanf("%f %f %f %f %f %f", &dt_s, &sample.x_m, &sample.pa_pa, &sample.pb_pa, &sample.spool,
                 &sample.ps_pa) == 6) {
        PitchleakResult result = pitchleak_valve_update(&estimator, dt_s, &sample);
        if (result < 0)
            return 2;
        if (result == PITCHLEAK_RESULT_RENEWED || result == PITCHLEAK_RESULT_CHANGED) {
            pitchleak_valve_find(&estimator, &found);
            printf("%.9g %.9g %.9g %.9g %.9g %.9g %d\n", found.internal_m3s.value, found.internal_m3s.std,
                   found.external_a_m3s.value, found.external_a_m3s.std, found.external_b_m3s.value,
                   found.external_b_m3s.std, found.alarms.external_a);
            /* What a restart goes on from: keep it where it survives, take it back with restore. */
            length = sizeof state;
            if (pitchleak_valve_save(&estimator, state, &length) < 0 ||
                pitchleak_valve_restore(&estimator, state, length) < 0)
                return 2;
        }
    }
    return 0;
}
