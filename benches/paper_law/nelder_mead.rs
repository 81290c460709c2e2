//! Minimum of a function of a few variables without derivatives (Nelder and Mead 1965, Comput. J. 7, 308), with the
//! usual constants: reflection 1, expansion 2, contraction ½, shrinkage ½.

/// A place and the function's value there.
#[derive(Clone, Debug)]
pub struct Found<const N: usize> {
    pub at: [f64; N],
    pub value: f64,
}

/// The lowest place found from all `starts`, each with a simplex of edges `edge` and `evaluations` evaluations, and
/// then once more from the best of them.
pub fn lowest<const N: usize>(
    of: impl Fn(&[f64; N]) -> f64,
    starts: &[[f64; N]],
    edge: f64,
    evaluations: usize,
) -> Found<N> {
    let descents = starts.iter().map(|start| descend(&of, start, edge, evaluations));
    let best = descents.min_by(|a, b| a.value.total_cmp(&b.value)).expect("there is a start");
    descend(&of, &best.at, -0.5 * edge, evaluations)
}

fn descend<const N: usize>(
    of: &impl Fn(&[f64; N]) -> f64,
    start: &[f64; N],
    edge: f64,
    evaluations: usize,
) -> Found<N> {
    let measured = |at: [f64; N]| Found { value: of(&at), at };
    let mut simplex: Vec<Found<N>> = vec![measured(*start)];
    for axis in 0..N {
        let mut at = *start;
        at[axis] += edge;
        simplex.push(measured(at));
    }
    let mut spent = N + 1;
    loop {
        simplex.sort_by(|a, b| a.value.total_cmp(&b.value));
        if spent >= evaluations {
            return simplex.swap_remove(0);
        }
        let worst = simplex.pop().expect("a simplex has corners");
        let (best, second_worst) = (simplex[0].value, simplex[N - 1].value);
        let centre: [f64; N] =
            std::array::from_fn(|axis| simplex.iter().map(|corner| corner.at[axis]).sum::<f64>() / N as f64);
        let beyond =
            |share: f64| measured(std::array::from_fn(|i| centre[i] + share * (centre[i] - worst.at[i])));
        let reflected = beyond(1.0);
        spent += 1;
        let next = if reflected.value < best {
            spent += 1;
            let expanded = beyond(2.0);
            if expanded.value < reflected.value { expanded } else { reflected }
        } else if reflected.value < second_worst {
            reflected
        } else {
            spent += 1;
            let contracted = beyond(if reflected.value < worst.value { 0.5 } else { -0.5 });
            if contracted.value < worst.value.min(reflected.value) {
                contracted
            } else {
                spent += N;
                let towards = simplex[0].at;
                let shrunk =
                    |corner: &Found<N>| measured(std::array::from_fn(|i| 0.5 * (corner.at[i] + towards[i])));
                simplex = std::iter::once(simplex[0].clone())
                    .chain(simplex[1..].iter().chain([&worst]).map(shrunk))
                    .collect();
                continue;
            }
        };
        simplex.push(next);
    }
}
