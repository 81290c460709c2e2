//! Every number that the diagnosis decides by, with where it comes from: *derived* from another or from a law,
//! *sourced* from a publication, or *chosen*: a convention, a guard or a matter of cost. The chosen ones come from no
//! optimisation, but they were chosen by people who saw the bench's cases and the simulator's traces. `tests/blind.rs`
//! notices where a change of one costs names on a small bench; how good each value is, nothing has measured.
//!
//! One idea has one number: what follows from these without a choice of its own (a bound for so many tests, half a block) is made
//! where it is used.

// Chance.

/// Share of sound rigs of which each kind of test may say something false, shared out over all tests of the kind (Bonferroni). Chosen.
pub(crate) const FALSE_RATE: f64 = 1e-3;
/// So many standard deviations from zero is not zero, and explanations that are closer cannot be told apart, where one test decides.
/// Chosen: the usual three.
pub(crate) const SIGNIFICANT_SIGMA: f64 = 3.0;
/// So many standard deviations are seen by whatever test. Derived: above the Bonferroni bound of about 4.2 by nearly one, so that four
/// of five such effects are found; the range of ten normal numbers stays within that, 99 of 100 times.
pub(crate) const EVIDENT_SIGMA: f64 = 5.0;
/// Lags of the portmanteau test. Chosen: two seconds of test functions.
pub(crate) const PORTMANTEAU_LAGS: usize = 20;
/// Fewer numbers than this tell nothing. Chosen: the law of large numbers' usual thirty.
pub(crate) const FEWEST_NUMBERS: usize = 30;
/// Bins of equal count in which a residual is held against a variable. Chosen: six see a slope, a bend and a step, and hold
/// [`FEWEST_NUMBERS`] each in 20 s.
pub(crate) const BINS: usize = 6;

// Shares.

/// Less than this share of the whole is not worth a word: of a column in an equation, of the residual, of a step between samples, of the
/// speed that friction feels, of the standard deviation of what still moves. Chosen: two digits are read.
pub(crate) const SMALL_SHARE: f64 = 0.02;
/// Less than this share is nothing: of motion in what is taken for noise, of the largest effect of an equation (a law that is wrong by 3 %
/// leaves that much), of a pivot, of a constant's range where a derivative is taken, as central differences err by its square. Chosen.
pub(crate) const NEGLIGIBLE_SHARE: f64 = 1e-3;
/// What the traces tell is more than what was known, or than noise, where it is more than this share. Chosen: half.
pub(crate) const MOST_OF: f64 = 0.5;
/// Parts of sums that are rounding. Derived: the root of that of a number.
pub(crate) const ROUNDING: f64 = 1e-8;

// Sensors and samples.

/// Below this share of full scale nothing is an effect. Sourced: one step of a 16-bit converter.
pub(crate) const RESOLUTION: f64 = 1.0 / 65_536.0;
/// Length of a block, s. Chosen: short against the machine's motion, long against a sample.
pub(crate) const BLOCK_S: f64 = 0.1;
/// Samples of a block at the most, and blocks of a hold. Chosen: 100 Hz, and a second.
pub(crate) const SAMPLES_PER_BLOCK: usize = 10;
/// Faster samples than this are averaged first, s. Derived: so many to a block.
pub(crate) const LEAST_STEP_S: f64 = BLOCK_S / SAMPLES_PER_BLOCK as f64;
/// So many samples are fitted at the most. Chosen for time: 13 minutes at 100 Hz, and ten seconds of two cores where many effects are
/// tried.
pub(crate) const MOST_SAMPLES: usize = 80_000;
/// A step is long beyond so many usual ones: a gap, or, of [`LEAST_STEP_S`], one that is integrated at two points. Chosen: samples of
/// 100 Hz are fast, those of 50 Hz are not.
pub(crate) const LONG_STEP: f64 = 1.5;
/// Steps are even that differ by less than this share. Chosen: the jitter of a recorder's clock.
pub(crate) const EVEN_SHARE: f64 = 0.1;
/// Dry friction has turned beyond so many times the speed within which it turns. Derived: tanh 3 = 0.995.
pub(crate) const TURNED: f64 = 3.0;
/// The machine moves no faster than that, Hz. Chosen: wind and pitch control stay below.
pub(crate) const FASTEST_MOTION_HZ: f64 = 2.0;
/// Noise is a ripple where it is larger than declared by this share, and correlated by it. Chosen: less harms nothing, and is four standard
/// deviations of the autocorrelation of third differences of 600 samples of white noise (Bartlett 1946).
pub(crate) const RIPPLE: f64 = 0.25;
/// Of a reading that stands, what its sensor's side is on average, of the straight way from the last motion to the next. Sourced: measured
/// on pressures in wind of 13 to 30 m/s under plays of 0.3 to 3 standard deviations of noise, 0.55 to 0.84 where it turns; where it goes on as
/// before nothing at 1.5 of what noise smoothing leaves, 0.1 at 5, 0.3 at 14.
pub(crate) const OF_STRAIGHT_WAY: f64 = 0.75;
/// Ratio of two plays that are tried one after the other. Chosen for cost.
pub(crate) const NEXT_PLAY: f64 = 1.2;

// The fit.

/// Rounds of whatever is repeated until it settles: linearisations, additions, exchanges, searches for changes. Chosen against cycles.
pub(crate) const MOST_ROUNDS: usize = 8;
/// Halvings of an interval that is searched. Derived: to a thousandth of it.
pub(crate) const HALVINGS: usize = 10;
/// Added to the diagonal of the scaled normal equations, so that collinear columns can be solved. Derived: as a prior
/// it is a billion times too wide to matter.
pub(crate) const COLLINEAR_RIDGE: f64 = 1e-11;
/// Pieces of the traces, each left out in turn. Chosen: enough for a jackknife.
pub(crate) const PIECES: usize = 20;

// The search.

/// Each constant fitted to the data counts as this many candidates. Chosen: more than the starts of the search (at most seven)
/// and fewer than its steps, since neighbouring constants give nearly the same column.
pub(crate) const CONSTANTS_TRIALS: usize = 20;
/// Parts of the range of a constant, from the middle of each of which the search starts. Chosen: ends and middle.
pub(crate) const SEARCH_STARTS: usize = 3;
/// A candidate below this share of the best is not worth a search for its constants. Chosen for cost.
pub(crate) const IN_THE_RUNNING: f64 = 0.4;
/// The search adds no further effect to so many. So many at once are rather one that no table has. Chosen: a hose is three, and two faults at
/// once are rare.
pub(crate) const MOST_EFFECTS: usize = 5;
/// Sets of effects near the named one that are fitted. Chosen for time.
pub(crate) const MOST_EXCHANGES: usize = 12;
/// A candidate's score is linear about the effect in whose place it would stand, and may err by this share: within it, it is fitted there.
/// Derived: the square of an effect of a fifth, which is beyond any gain or area in use.
pub(crate) const CURVED_SHARE: f64 = 0.04;
/// So many effects that leave more than noise are not trusted before leaks that change are asked. Chosen: two faults at once are rare.
pub(crate) const FEW_EFFECTS: usize = 2;
/// Places that a change is looked for at, before it is moved to the row that it is best at. Chosen for time.
pub(crate) const MOST_CHANGE_PLACES: usize = 2000;

// The verdict.

/// An effect is doubtful where the residual of its equations beyond noise is more than this share of that and what it
/// explains together. Chosen: nine tenths mended.
pub(crate) const UNMENDED_SHARE: f64 = 0.1;
/// What the probability of a name is multiplied by where something speaks against it that is no rival in its place. Measured: of 251 such
/// names of `benches/subsets.rs` 141 are right.
pub(crate) const DOUBTED_ODDS: f64 = 0.5;
/// A leak known to within this flow at the mean pressure is identified, m³/s. Chosen: 0.1 L/min.
pub(crate) const IDENTIFIED_M3S: f64 = 0.1 / 60e3;

// Holds.

/// The piston stands while its means over a hold's blocks stay within this share of what it travels elsewhere in the trace in the
/// same time (under load it creeps by what leaks), or within their noise. Chosen.
pub(crate) const STILL_SHARE_OF_TRAVEL: f64 = 0.05;
/// Below this a chamber is not under pressure, Pa gauge. Chosen: 10 bar.
pub(crate) const LEAST_HELD_PA: f64 = 1e6;
