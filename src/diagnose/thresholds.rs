//! Every number that the diagnosis decides by, with where it comes from: *derived* from another or from a law,
//! *sourced* from a publication, or *chosen*: a convention, a guard or a matter of cost. The chosen ones come from no
//! optimisation, but they were chosen by people who saw the bench's cases and the simulator's traces. `tests/blind.rs`
//! notices where a change of one costs names on a small bench; how good each value is, nothing has measured.

// Chance.

/// Share of sound rigs on which the search may name anything, shared out over all candidates (Bonferroni). Chosen.
pub(crate) const FALSE_EFFECT_RATE: f64 = 1e-3;
/// A sound rig fails any one test of the residual this rarely. Derived: size and whiteness of three equations and one
/// test for unlisted products make seven, so that 1.4 in a thousand sound rigs are complained about, as many as are
/// named an effect.
pub(crate) const LEAST_P: f64 = 2e-4;
/// The residual counts as noise unless its variance is this many standard deviations too large. Derived: the normal
/// law's two-sided bound of [`LEAST_P`].
pub(crate) const CHANCE_SIGMA: f64 = 3.7;
/// Share of diagnoses in which a product of two effects may be reported by chance. Derived: as [`FALSE_EFFECT_RATE`].
pub(crate) const FALSE_PRODUCT_RATE: f64 = FALSE_EFFECT_RATE;
/// A variable that the residual goes with is named where chance does so once in a hundred diagnoses. Chosen.
pub(crate) const CHANCE_RATE: f64 = 0.01;
/// Lags of the portmanteau test. Chosen: two seconds of test functions.
pub(crate) const PORTMANTEAU_LAGS: usize = 20;
/// Half width of the 95 % interval of a normal law, in standard deviations. Derived.
pub(crate) const CI95_SIGMA: f64 = 1.96;

// Sensors and samples.

/// Below this share of full scale nothing is an effect. Sourced: one step of a 16-bit converter.
pub(crate) const RESOLUTION: f64 = 1.0 / 65_536.0;
/// Faster samples than this are averaged first, s. Chosen: ten samples to a block of [`BLOCK_S`].
pub(crate) const LEAST_STEP_S: f64 = 0.01;
/// So many samples of at least that length are fitted at the most. Chosen for time: 13 minutes at 100 Hz, and ten
/// seconds of two cores where many effects are tried.
pub(crate) const MOST_SAMPLES: usize = 80_000;
/// Samples of that length in a piece of a trace too long to be fitted whole. Chosen: 20 s at 100 Hz, so that ends of
/// pieces cost one test function in a hundred.
pub(crate) const PIECE_SAMPLES: usize = 2000;
/// The machine moves no faster than that, Hz. Chosen: wind and pitch control stay below.
pub(crate) const FASTEST_MOTION_HZ: f64 = 1.4;
/// Share of such motion that may stay in what is taken for noise. Chosen: a hundredth of the noise of a sensor of 0.1 % for
/// motion over a twentieth of its full scale.
pub(crate) const MOTION_LEFT: f64 = 2.5e-4;
/// Noise beyond the declared one by so many standard deviations of its estimate is taken for the sensor's own. Chosen: once in a
/// thousand sound rigs for six sensors.
pub(crate) const NOISIER_SIGMA: f64 = 3.5;
/// Of the median of sizes of normal numbers against their root mean square. Sourced: Rousseeuw and Croux (1993).
pub(crate) const MEDIAN_EFFICIENCY: f64 = 0.37;
/// Regular noise this many times the declared one is a ripple. Chosen: less harms nothing.
pub(crate) const RIPPLE: f64 = 1.25;
/// A row's samples show more than noise where their differences' root mean square is so many standard deviations.
/// Chosen: three.
pub(crate) const UNRESOLVED_SIGMA: f64 = 3.0;
/// Correlation of fast noise beyond which it is a ripple. Derived: the autocorrelation of third differences of 600
/// samples of white noise has a standard deviation of √(2.3/600) = 0.06 (Bartlett 1946); this is four of them.
pub(crate) const RIPPLE_COLOUR: f64 = 0.25;
/// Wanted noise of the speed as a share of its root mean square. Chosen: friction's column is as exact as that.
pub(crate) const SPEED_NOISE_SHARE: f64 = 0.02;
/// No window for smoothing the speed is longer than this, s. Derived: one block, [`BLOCK_S`].
pub(crate) const LONGEST_WINDOW_S: f64 = BLOCK_S;
/// Below so many standard deviations of the speed's noise, or this share of its root mean square, the direction of
/// motion is not known. Chosen: three standard deviations; the share stands for what no noise tells, as creep.
pub(crate) const LEAST_SURE_SIGMA: f64 = 3.0;
/// See [`LEAST_SURE_SIGMA`].
pub(crate) const LEAST_SURE_SHARE: f64 = 5e-3;
/// A pressure reading moves once it has left its last place by so many standard deviations of its smoothed noise, and has turned once it
/// has come back by twice that. Chosen: noise turns what stands for ten seconds one
/// time in ten, and real turns are seen soon.
pub(crate) const TURNED_SIGMA: f64 = 3.0;

// Play and dead bands.

/// A reading stands when it has not moved for so long, s: noise alone hides slow motion for less. Derived: half of [`BLOCK_S`].
pub(crate) const LONGEST_STILL_S: f64 = BLOCK_S / 2.0;
/// Of a reading that stands, what its sensor's side is on average, of the straight way from the last motion to the next. Sourced: measured
/// on pressures in wind of 5 to 30 m/s under plays of 0.3 and 2 bar, 0.5 to 0.9 where it turns, 0 to 0.9 where it goes on as before.
pub(crate) const OF_STRAIGHT_WAY: f64 = 0.5;
/// What moves a sensor is at an end of its play from this share of it on. Derived: one less rounding.
pub(crate) const AT_END: f64 = 0.999;
/// χ² by which a play must explain the position better than none does. Derived: six standard deviations, for the best of many plays is taken.
pub(crate) const EVIDENT_CHI2: f64 = 36.0;
/// Ratio of two plays that are tried one after the other. Chosen for cost.
pub(crate) const NEXT_PLAY: f64 = 1.2;
/// Steps of the last search between two of them. Derived: to a 64th of their ratio.
pub(crate) const PLAY_REFINEMENTS: usize = 6;
/// A meter shows nothing below so many standard deviations of its noise. Chosen: the median of three leaves that by noise once in a
/// hundred thousand samples.
pub(crate) const SHOWN_SIGMA: f64 = 3.0;

// Weak form.

/// Length of a block, s. Chosen: short against the machine's motion, long against a sample.
pub(crate) const BLOCK_S: f64 = 0.1;
/// Steps longer than this many [`LEAST_STEP_S`] are integrated at two points. Chosen: samples of 100 Hz are fast, those of 50 Hz
/// are not.
pub(crate) const LONG_STEP: f64 = 1.5;
/// Steps are even that differ by less than this share. Chosen: the jitter of a recorder's clock.
pub(crate) const EVEN_SHARE: f64 = 0.1;
/// Share of a test function that is rounding, not time. Derived: far above the rounding of a sum of samples, far below one.
pub(crate) const SLIVER: f64 = 1e-6;
/// Variance of an entry that must not count, times its own. Derived: its weight is then below rounding of the rest.
pub(crate) const IGNORED: f64 = 1e8;
/// A pivot of the covariance is at least this share of its variance. Chosen: guards the root against rounding.
pub(crate) const LEAST_PIVOT: f64 = 1e-3;
/// Step of a derivative, as a share of an effect's usual size. Derived: central differences err by its square.
pub(crate) const DERIVATIVE_STEP: f64 = 1e-2;
/// Realisations of sensor noise whose mean products correct the columns that carry it. Chosen: their mean scatters
/// half as much as one of them.
pub(crate) const NOISE_DRAWS: u64 = 4;

/// At most this share of what is new in a column counts as noise of its own. Chosen: beyond a half the correction is a guess.
pub(crate) const MOST_NOISE_SHARE: f64 = 0.5;

// The fit.

/// The oil stays within so many standard deviations of its prior, and at this share of 1/β at least: what is softer
/// or stiffer is not oil but an effect. Chosen: three standard deviations; the share keeps β finite.
pub(crate) const OIL_SIGMA: f64 = 3.0;
/// See [`OIL_SIGMA`].
pub(crate) const LEAST_COMPRESSIBILITY: f64 = 0.3;
/// Gauss–Newton has converged once a further round would move no estimate by more than this share of its standard
/// deviation, and no equation's noise by more than this share of itself. Derived: an interval of ± two standard
/// deviations is read to two digits.
pub(crate) const SETTLED_SIGMA: f64 = 0.02;
/// See [`SETTLED_SIGMA`].
pub(crate) const SETTLED_NOISE: f64 = 0.02;
/// Linearisations after which Gauss–Newton is given up, and says so. Chosen for cost.
pub(crate) const MOST_ROUNDS: usize = 8;
/// Halvings of the interval that holds the equation error. Derived: to 2⁻¹⁶ of it.
pub(crate) const BISECTIONS: usize = 16;
/// Halvings of the share of fast signals that is noise. Derived: to 2⁻⁶ of it.
pub(crate) const SHARE_BISECTIONS: usize = 6;
/// A term held at a value has this share of its own standard deviation as prior. Derived: it moves by 1e-8 of it.
pub(crate) const HELD: f64 = 1e-4;
/// Added to the diagonal of the scaled normal equations, so that collinear columns can be solved. Derived: as a prior
/// it is a billion times too wide to matter.
pub(crate) const COLLINEAR_RIDGE: f64 = 1e-11;
/// The part of a column that is left after the others explain it, below which it tells nothing new. Derived: the root of
/// rounding.
pub(crate) const LEAST_NEW_SHARE: f64 = 1e-8;
/// Held-out parts of the data. Chosen: the usual five (Hastie, Tibshirani and Friedman 2009, section 7.10).
pub(crate) const FOLDS: usize = 5;
/// The traces are cut into so many pieces; fold f is every fifth piece from f. Chosen: enough for a jackknife.
pub(crate) const PIECES: usize = 4 * FOLDS;

// The search.

/// Constants fitted to the data count as this many candidates. Chosen: more than the starts of the search (at most seven)
/// and fewer than its steps, since neighbouring constants give nearly the same column.
pub(crate) const CONSTANTS_TRIALS: usize = 20;
/// Effects that one diagnosis names at most. Chosen: with two of the rig file they fill the core's set of eight.
pub(crate) const MOST_EFFECTS: usize = 6;
/// Additions, counting those that are taken back. Chosen against cycles.
pub(crate) const MOST_STEPS: usize = 10;
/// Times that another set is named in the place of one. Chosen against cycles.
pub(crate) const MOST_SWAPS: usize = 4;
/// Named effects that others may stand for together. Chosen for cost.
pub(crate) const MOST_EXCHANGED: usize = 3;
/// Sets of effects near the named one that are fitted. Chosen for time.
pub(crate) const MOST_EXCHANGES: usize = 12;
/// While the residual is larger than the noise, an effect must mend this share of it to be named.
/// Chosen: below that it is too small to be told from what the wrong equations make of it.
pub(crate) const LEAST_MENDED_SHARE: f64 = 0.02;
/// A candidate below this share of the best is not worth a search for its constants. Chosen for cost.
pub(crate) const IN_THE_RUNNING: f64 = 0.4;
/// Standard deviations by the jackknife that an effect must have beside an unexplained residual. Chosen: three.
pub(crate) const AGREED_SIGMA: f64 = 3.0;
/// A lag is not named below this share of the time between two samples. Chosen: integrals between samples are no better than that.
pub(crate) const LEAST_LAG_SHARE: f64 = 0.01;
/// Candidates whose fit is this close cannot be told apart. Derived: three standard deviations.
pub(crate) const CONFUSABLE_CHI2: f64 = 9.0;
/// The ln of larger odds is certainty. Derived: far beyond any evidence that is told, far below what has no exponential.
pub(crate) const MOST_LN_ODDS: f64 = 300.0;
/// A candidate's score is linear about the effect in whose place it would stand, and may err by this share: within it, it is fitted there.
/// Derived: the square of an effect of a fifth, which is beyond any gain or area in use.
pub(crate) const CURVED_SHARE: f64 = 0.04;
/// A score below this is not worth a search for constants. Derived: three standard deviations.
pub(crate) const WORTH_SEARCHING: f64 = 9.0;
/// Steps of the search for constants. Chosen against cycles.
pub(crate) const MOST_CLIMBS: usize = 40;
/// First and last step of that search as shares of a constant's range. Chosen: from a fifth down to what shows in a
/// fitted constant.
pub(crate) const FIRST_STEP: f64 = 0.2;
/// See [`FIRST_STEP`].
pub(crate) const LAST_STEP: f64 = 0.002;
/// What a step must gain. Derived: half of what chance brings to one fitted constant.
pub(crate) const LEAST_CLIMB: f64 = 0.5;
/// Where the other constants of a range stand meanwhile. Chosen: bells and bends are narrow.
pub(crate) const OTHERS_SHARE: f64 = 0.3;
/// Half the step of a derivative by a constant, as a share of its range. Derived: central differences err by its square.
pub(crate) const CONSTANT_STEP: f64 = 0.01;
/// Places along the range of each constant from which the search starts. Chosen: ends and middle.
pub(crate) const SEARCH_STARTS: [f64; 3] = [0.15, 0.5, 0.85];

// Leaks that change.

/// So many effects that leave more than noise are not trusted before leaks that change are asked. Chosen: two faults at once are rare.
pub(crate) const FEW_EFFECTS: usize = 2;
/// χ² that leaks of its own must explain of a part of the traces. Derived: three leaks that grow, at one of two thousand places, do so by
/// chance once in a million traces.
pub(crate) const CHANGE_CHI2: f64 = 54.0;
/// Places that a change is looked for at, before it is moved to the row that it is best at. Chosen for time.
pub(crate) const MOST_CHANGE_PLACES: usize = 2000;
/// How often changes are looked for, at ever less noise. Chosen against cycles.
pub(crate) const MOST_CHANGE_ROUNDS: usize = 4;

// The verdict.

/// Fewer numbers than this have no distribution. Chosen: below, skewness and kurtosis are far from normal.
pub(crate) const FEWEST_FOR_MOMENTS: usize = 80;
/// Bins of equal count in which a residual is drawn against a variable. Chosen for the eye.
pub(crate) const DRAWN_BINS: usize = 12;
/// An effect acts in an equation that has more than this share of its column. Chosen: a hundredth.
pub(crate) const ACTS_SHARE: f64 = 0.01;
/// A volume's ratio to the bulk modulus is well known where its standard deviation is this share of the volume's own. Chosen: half.
pub(crate) const RATIO_KNOWN_SHARE: f64 = 0.5;
/// Fewer test functions than this tell nothing. Chosen: the law of large numbers' usual thirty.
pub(crate) const FEWEST_ROWS: usize = 30;
/// An effect of this many standard deviations is called detectable. Derived: above the Bonferroni bound of about 4.2
/// by nearly one, so that four of five are found.
pub(crate) const DETECTABLE_SIGMA: f64 = 5.0;
/// An effect is doubtful where the residual of its equations beyond noise is more than this share of that and what it
/// explains together. Chosen: nine tenths mended.
pub(crate) const UNMENDED_SHARE: f64 = 0.1;
/// What the probability of a name is multiplied by where something speaks against it that is no rival in its place. Measured: of 251 such
/// names of `benches/subsets.rs` 141 are right.
pub(crate) const DOUBTED_ODDS: f64 = 0.5;
/// Bins of equal count in which the residual is averaged against a variable. Chosen: six see a slope, a bend and a step, and hold
/// [`FEWEST_ROWS`] each in 20 s.
pub(crate) const SHAPE_BINS: usize = 6;
/// An effect that mends less than this share of what another of the same equation does may be that one's error. Chosen: a law that
/// is wrong by 3 % leaves that much.
pub(crate) const LEAST_SHARE_BESIDE: f64 = 1e-3;
/// More effects at once than that are rather one that no table has. Chosen: a hose is three, and two faults at once are rare.
pub(crate) const MOST_BELIEVED: usize = 4;
/// A leak this many standard deviations below zero takes confidence from the effects of its chamber. Chosen: two.
pub(crate) const DOUBTED_LEAK_SIGMA: f64 = 2.0;
/// A leak this many standard deviations below zero is evidence against the model. Chosen: three.
pub(crate) const NEGATIVE_SIGMA: f64 = 3.0;
/// A leak known to within this flow at the mean pressure is identified, m³/s. Chosen: 0.1 L/min.
pub(crate) const IDENTIFIED_M3S: f64 = 0.1 / 60e3;
/// The bulk modulus is identified when less than this share of its prior's standard deviation is left. Chosen.
pub(crate) const LEARNT_SHARE: f64 = 0.5;

// Holds.

/// A hold lasts so long, s. Chosen: ten of [`BLOCK_S`].
pub(crate) const HOLD_S: f64 = 1.0;
/// Pieces of a hold whose mean positions are compared. Derived: [`HOLD_S`] over [`BLOCK_S`].
pub(crate) const HOLD_PIECES: usize = 10;
/// The piston stands while those means stay within this share of what it travels elsewhere in the trace in the
/// same time (under load it creeps by what leaks), of the stroke, or within their noise. Chosen.
pub(crate) const STILL_SHARE_OF_TRAVEL: f64 = 0.05;
/// See [`STILL_SHARE_OF_TRAVEL`].
pub(crate) const STILL_SHARE_OF_STROKE: f64 = 1e-4;
/// See [`STILL_SHARE_OF_TRAVEL`]. Derived: the range of ten normal numbers stays within that.
pub(crate) const STILL_SIGMA: f64 = 6.0;
/// Below this a chamber is not under pressure, Pa gauge. Chosen: 10 bar.
pub(crate) const LEAST_HELD_PA: f64 = 1e6;
/// Fewer holds than this are no check. Derived: a scatter needs three.
pub(crate) const FEWEST_HOLDS: usize = 3;
