/* The leak estimator of pitchleak for C and C++. Made by cbindgen; do not edit. One page shows how to use it:
   examples/leaks.c, without flow meters examples/valve.c. Two threads may not use one estimator at the same time. */

#ifndef PITCHLEAK_H
#define PITCHLEAK_H

#include <stddef.h>
#include <stdint.h>

// Size of `Pitchleak4` in 64-bit words.
#define PITCHLEAK4_WORDS 324

// A state is never longer, bytes.
#define PITCHLEAK4_STATE_BYTES 2592

// Size of `Pitchleak6` in 64-bit words.
#define PITCHLEAK6_WORDS 474

// A state is never longer, bytes.
#define PITCHLEAK6_STATE_BYTES 3792

// Size of `Pitchleak9` in 64-bit words.
#define PITCHLEAK9_WORDS 783

// A state is never longer, bytes.
#define PITCHLEAK9_STATE_BYTES 6264

// Numbers in `mean` of `valve.toml`.
#define PITCHLEAK_VALVE_UNKNOWNS 23

// Numbers in `covariance` of `valve.toml`.
#define PITCHLEAK_VALVE_COVARIANCES 276

// Size of `PitchleakValve` in 64-bit words.
#define PITCHLEAK_VALVE_WORDS 370

// A state is never longer, bytes.
#define PITCHLEAK_VALVE_STATE_BYTES 2968

// What a function did: zero or above where all is well.
enum PitchleakResult
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Done; of a sample: taken in.
  PITCHLEAK_RESULT_OK = 0,
  // The first sample, or the first after a gap: nothing to integrate yet.
  PITCHLEAK_RESULT_STARTED = 1,
  // The sample was taken in, and the estimates are new.
  PITCHLEAK_RESULT_RENEWED = 2,
  // Renewed, after a sudden change of the leak: what was learnt before no longer counts.
  PITCHLEAK_RESULT_CHANGED = 3,
  // The sample was left out: not a number, or beyond what a cylinder can do.
  PITCHLEAK_RESULT_REJECTED = 4,
  // A pointer is null.
  PITCHLEAK_RESULT_NULL_POINTER = -1,
  // The estimator was not begun, or its memory was overwritten.
  PITCHLEAK_RESULT_NOT_BEGUN = -2,
  // The cylinder or its oil is impossible.
  PITCHLEAK_RESULT_BAD_CYLINDER = -3,
  // A sensor's noise, bias or gain error is negative or not a number.
  PITCHLEAK_RESULT_BAD_SENSORS = -4,
  // An alarm's threshold is not positive.
  PITCHLEAK_RESULT_BAD_THRESHOLD = -5,
  // The buffer is too small.
  PITCHLEAK_RESULT_TOO_SMALL = -6,
  // The bytes are no state, or a damaged one.
  PITCHLEAK_RESULT_DAMAGED = -7,
  // The bytes are the state of another version, or of an estimator of another size.
  PITCHLEAK_RESULT_OTHER_VERSION = -8,
  // A number of the valve's calibration cannot be.
  PITCHLEAK_RESULT_BAD_CALIBRATION = -9,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PitchleakResult PitchleakResult;
#else
typedef int32_t PitchleakResult;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Memory of an estimator of leaks and compressibility. Begin with `pitchleak4_begin`;
// it may be moved and copied.
typedef struct Pitchleak4 {
  // Not for reading.
  uint64_t words[PITCHLEAK4_WORDS];
} Pitchleak4;

// The cylinder; A is the piston side.
typedef struct PitchleakCylinder {
  // Piston area of chamber A, m².
  float area_a_m2;
  // Piston area of chamber B, less the rod, m².
  float area_b_m2;
  // Stroke, m.
  float stroke_m;
  // Piston, rod and what moves with them, kg.
  float moving_mass_kg;
  // Oil in port and hose of chamber A at x = 0, m³.
  float dead_volume_a_m3;
  // Oil in port and hose of chamber B at full stroke, m³.
  float dead_volume_b_m3;
} PitchleakCylinder;

// The oil.
typedef struct PitchleakFluid {
  // Bulk modulus, Pa.
  float bulk_modulus_pa;
  // How well it is known, one standard deviation, Pa.
  float bulk_modulus_std_pa;
} PitchleakFluid;

// How far a sensor's reading may be off, one standard deviation each, in the sensor's SI unit.
typedef struct PitchleakSensor {
  // White noise of one reading.
  float noise_std;
  // Constant offset; estimated by `Pitchleak6` and `Pitchleak9`.
  float bias_std;
  // Scale error, as a share of the reading; estimated by `Pitchleak9`.
  float gain_std;
  // How far the offset may drift in an hour; followed by `Pitchleak6` and `Pitchleak9`.
  float drift_std_ph;
} PitchleakSensor;

// All that is declared.
typedef struct PitchleakRig {
  // The cylinder.
  struct PitchleakCylinder cylinder;
  // Its oil.
  struct PitchleakFluid fluid;
  // Flow meter of chamber A, m³/s.
  struct PitchleakSensor flow_a;
  // Flow meter of chamber B, m³/s.
  struct PitchleakSensor flow_b;
  // Both pressure sensors, Pa.
  struct PitchleakSensor pressure;
  // Position sensor, m.
  struct PitchleakSensor position;
  // Internal leak that raises an alarm, m³/s.
  float threshold_internal_m3s;
  // External leak of chamber A that raises an alarm, m³/s.
  float threshold_external_a_m3s;
  // External leak of chamber B that raises an alarm, m³/s.
  float threshold_external_b_m3s;
  // A longer step, s, is a gap: nothing is integrated over it. 0.5 is usual.
  float max_step_s;
} PitchleakRig;

// One reading of the sensors, SI; pressures are gauge, a flow is positive into its chamber.
typedef struct PitchleakSample {
  // Piston position from the A end, m.
  float x_m;
  // Pressure of chamber A, Pa.
  float pa_pa;
  // Pressure of chamber B, Pa.
  float pb_pa;
  // Flow into chamber A, m³/s; NaN where it is not measured.
  float qa_m3s;
  // Flow into chamber B, m³/s; NaN where it is not measured.
  float qb_m3s;
} PitchleakSample;

// A value and its standard deviation.
typedef struct PitchleakEstimate {
  // Best value.
  float value;
  // Standard deviation; infinite where nothing is known.
  float std;
} PitchleakEstimate;

// Which alarms are active, 1 or 0.
typedef struct PitchleakAlarms {
  // Internal leak.
  uint8_t internal;
  // External leak of chamber A.
  uint8_t external_a;
  // External leak of chamber B.
  uint8_t external_b;
} PitchleakAlarms;

// What has been found so far.
typedef struct PitchleakFound {
  // Internal leak past the piston at the mean pressures, m³/s.
  struct PitchleakEstimate internal_m3s;
  // Leak out of chamber A at its mean pressure, m³/s.
  struct PitchleakEstimate external_a_m3s;
  // Leak out of chamber B at its mean pressure, m³/s.
  struct PitchleakEstimate external_b_m3s;
  // Coefficient of the internal leak, m³/(s·Pa).
  struct PitchleakEstimate internal_m3spa;
  // Coefficient of the leak out of chamber A, m³/(s·Pa).
  struct PitchleakEstimate external_a_m3spa;
  // Coefficient of the leak out of chamber B, m³/(s·Pa).
  struct PitchleakEstimate external_b_m3spa;
  // Compressibility of the oil, 1/Pa: one over the bulk modulus.
  struct PitchleakEstimate compressibility_per_pa;
  // Normalised innovation squared of the balance: 1 where the model and the declared noise explain the readings.
  float innovation_balance;
  // Normalised innovation squared of the position equation.
  float innovation_position;
  // Active alarms.
  struct PitchleakAlarms alarms;
} PitchleakFound;

// Memory of an estimator of leaks, compressibility and the flow meters' offsets. Begin with `pitchleak6_begin`;
// it may be moved and copied.
typedef struct Pitchleak6 {
  // Not for reading.
  uint64_t words[PITCHLEAK6_WORDS];
} Pitchleak6;

// Memory of an estimator of leaks, compressibility, the flow meters' offsets and the gains of flow meters and position sensor. Begin with `pitchleak9_begin`;
// it may be moved and copied.
typedef struct Pitchleak9 {
  // Not for reading.
  uint64_t words[PITCHLEAK9_WORDS];
} Pitchleak9;

// Memory of an estimator of leaks by a calibrated valve. Begin with `pitchleak_valve_begin`; it may be moved and
// copied.
typedef struct PitchleakValve {
  // Not for reading.
  uint64_t words[PITCHLEAK_VALVE_WORDS];
} PitchleakValve;

// A cylinder without flow meters, its calibrated valve and its sensors. `pitchleak calibrate` writes `mean` and
// `covariance` into `valve.toml`; all else of the valve stands in `[valve]` of the rig file.
typedef struct PitchleakValveRig {
  // The cylinder.
  struct PitchleakCylinder cylinder;
  // Its oil.
  struct PitchleakFluid fluid;
  // `mean` of `valve.toml`, in its order.
  float mean[PITCHLEAK_VALVE_UNKNOWNS];
  // `covariance` of `valve.toml`, one row after the other: 1 number, 2 numbers, … 23 numbers.
  float covariance[PITCHLEAK_VALVE_COVARIANCES];
  // `rated_flow`: over one fully open edge, m³/s, …
  float rated_flow_m3s;
  // … at `rated_drop`, Pa.
  float rated_drop_pa;
  // `tank`, Pa.
  float tank_pa;
  // `hysteresis`, a share of the stroke; 0.003 where the rig file has none.
  float hysteresis;
  // `null_leak`, a share of the rated flow; 0.02 where the rig file has none.
  float null_leak;
  // `drift.gain`; 0.03 where the rig file has none.
  float gain_drift;
  // `drift.lap`; 0.001 where the rig file has none.
  float lap_drift;
  // `drift.null_leak`; 0.1 where the rig file has none.
  float null_leak_drift;
  // Noise of one position, one standard deviation, m: a third of `accuracy` of full scale, as are the three that follow.
  float position_std_m;
  // Noise of a chamber pressure, Pa.
  float pressure_std_pa;
  // Noise of the spool's position, a share of its stroke.
  float spool_std;
  // Noise of the supply pressure, Pa.
  float supply_std_pa;
  // Internal leak that raises an alarm, m³/s.
  float threshold_internal_m3s;
  // External leak of chamber A that raises an alarm, m³/s.
  float threshold_external_a_m3s;
  // External leak of chamber B that raises an alarm, m³/s.
  float threshold_external_b_m3s;
  // A longer step, s, is a gap: nothing is integrated over it. 0.5 is usual.
  float max_step_s;
} PitchleakValveRig;

// One reading of the sensors, SI; pressures are gauge.
typedef struct PitchleakValveSample {
  // Piston position from the A end, m.
  float x_m;
  // Pressure of chamber A, Pa.
  float pa_pa;
  // Pressure of chamber B, Pa.
  float pb_pa;
  // Position of the spool, a share of its stroke; above zero it feeds A.
  float spool;
  // Supply pressure at the valve, Pa.
  float ps_pa;
} PitchleakValveSample;

// What has been found so far.
typedef struct PitchleakValveFound {
  // Internal leak past the piston at the mean pressures of the last minute, m³/s.
  struct PitchleakEstimate internal_m3s;
  // Leak out of chamber A at its mean pressure, m³/s; since the calibration, where that was made with `--leaks unknown`.
  struct PitchleakEstimate external_a_m3s;
  // Leak out of chamber B at its mean pressure, m³/s, likewise.
  struct PitchleakEstimate external_b_m3s;
  // Coefficient of the internal leak, m³/(s·Pa).
  struct PitchleakEstimate internal_m3spa;
  // Coefficient of the leak out of chamber A, m³/(s·Pa).
  struct PitchleakEstimate external_a_m3spa;
  // Coefficient of the leak out of chamber B, m³/(s·Pa).
  struct PitchleakEstimate external_b_m3spa;
  // Compressibility of the oil, 1/Pa: one over the bulk modulus.
  struct PitchleakEstimate compressibility_per_pa;
  // Normalised innovation squared: 1 where the declared noise explains the readings.
  float innovation;
  // 1 where a valve as calibrated, its leaks and noise explain the readings, from half a minute on; alarms rest else.
  uint8_t is_explained;
  // Active alarms.
  struct PitchleakAlarms alarms;
} PitchleakValveFound;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Begins anew for a rig.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak4_begin(struct Pitchleak4 *estimator, const struct PitchleakRig *rig);

// Takes in a sample, `dt_s` after the one before.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak4_update(struct Pitchleak4 *estimator,
                                  float dt_s,
                                  const struct PitchleakSample *sample);

// Tells what has been found so far.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak4_find(const struct Pitchleak4 *estimator, struct PitchleakFound *found);

// Writes the state to `bytes`, of which there are `*length`; afterwards `*length` were written.
// PITCHLEAK4_STATE_BYTES are enough.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak4_save(const struct Pitchleak4 *estimator, uint8_t *bytes, size_t *length);

// Goes on from a state that `pitchleak4_save` wrote, on this machine or another; other bytes leave the
// estimator as it was.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak4_restore(struct Pitchleak4 *estimator, const uint8_t *bytes, size_t length);

// Begins anew for a rig.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak6_begin(struct Pitchleak6 *estimator, const struct PitchleakRig *rig);

// Takes in a sample, `dt_s` after the one before.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak6_update(struct Pitchleak6 *estimator,
                                  float dt_s,
                                  const struct PitchleakSample *sample);

// Tells what has been found so far.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak6_find(const struct Pitchleak6 *estimator, struct PitchleakFound *found);

// Writes the state to `bytes`, of which there are `*length`; afterwards `*length` were written.
// PITCHLEAK6_STATE_BYTES are enough.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak6_save(const struct Pitchleak6 *estimator, uint8_t *bytes, size_t *length);

// Goes on from a state that `pitchleak6_save` wrote, on this machine or another; other bytes leave the
// estimator as it was.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak6_restore(struct Pitchleak6 *estimator, const uint8_t *bytes, size_t length);

// Begins anew for a rig.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak9_begin(struct Pitchleak9 *estimator, const struct PitchleakRig *rig);

// Takes in a sample, `dt_s` after the one before.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak9_update(struct Pitchleak9 *estimator,
                                  float dt_s,
                                  const struct PitchleakSample *sample);

// Tells what has been found so far.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak9_find(const struct Pitchleak9 *estimator, struct PitchleakFound *found);

// Writes the state to `bytes`, of which there are `*length`; afterwards `*length` were written.
// PITCHLEAK9_STATE_BYTES are enough.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak9_save(const struct Pitchleak9 *estimator, uint8_t *bytes, size_t *length);

// Goes on from a state that `pitchleak9_save` wrote, on this machine or another; other bytes leave the
// estimator as it was.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak9_restore(struct Pitchleak9 *estimator, const uint8_t *bytes, size_t length);

// Begins anew for a rig.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak_valve_begin(struct PitchleakValve *estimator, const struct PitchleakValveRig *rig);

// Takes in a sample, `dt_s` after the one before.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak_valve_update(struct PitchleakValve *estimator,
                                       float dt_s,
                                       const struct PitchleakValveSample *sample);

// Tells what has been found so far.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak_valve_find(const struct PitchleakValve *estimator,
                                     struct PitchleakValveFound *found);

// Writes the state to `bytes`, of which there are `*length`; afterwards `*length` were written.
// PITCHLEAK_VALVE_STATE_BYTES are enough.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak_valve_save(const struct PitchleakValve *estimator, uint8_t *bytes, size_t *length);

// Goes on from a state that `pitchleak_valve_save` wrote, on this machine or another; other bytes leave the
// estimator as it was.
//
// # Safety
// Each pointer is null, or what it says.
PitchleakResult pitchleak_valve_restore(struct PitchleakValve *estimator,
                                        const uint8_t *bytes,
                                        size_t length);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* PITCHLEAK_H */

/* What the library was built with. */
#if defined(__cplusplus)
#define PITCHLEAK_ASSERT(claim) static_assert(claim, #claim)
#define PITCHLEAK_ALIGNOF alignof
#else
#define PITCHLEAK_ASSERT(claim) _Static_assert(claim, #claim)
#define PITCHLEAK_ALIGNOF _Alignof
#endif
PITCHLEAK_ASSERT(sizeof(Pitchleak4) == 8 * PITCHLEAK4_WORDS && PITCHLEAK_ALIGNOF(Pitchleak4) == 8);
PITCHLEAK_ASSERT(sizeof(Pitchleak6) == 8 * PITCHLEAK6_WORDS && PITCHLEAK_ALIGNOF(Pitchleak6) == 8);
PITCHLEAK_ASSERT(sizeof(Pitchleak9) == 8 * PITCHLEAK9_WORDS && PITCHLEAK_ALIGNOF(Pitchleak9) == 8);
PITCHLEAK_ASSERT(sizeof(PitchleakRig) == 112 && sizeof(PitchleakSample) == 20 && sizeof(PitchleakFound) == 68);
PITCHLEAK_ASSERT(sizeof(PitchleakValve) == 8 * PITCHLEAK_VALVE_WORDS && PITCHLEAK_ALIGNOF(PitchleakValve) == 8);
PITCHLEAK_ASSERT(sizeof(PitchleakValveRig) == 1292 && sizeof(PitchleakValveSample) == 20);
PITCHLEAK_ASSERT(sizeof(PitchleakValveFound) == 64 && sizeof(PitchleakResult) == 4);
#undef PITCHLEAK_ASSERT
#undef PITCHLEAK_ALIGNOF
