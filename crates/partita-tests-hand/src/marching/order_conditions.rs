//! Every table against the theory of rooted trees: for each tree τ with density γ(τ) and elementary weight φ(τ), a
//! method of order p has Σ b_i φ_i(τ) = 1/γ(τ) up to p vertices, its error estimate Σ e_i φ_i(τ) = 0 up to its own
//! order, and its dense output Σ b_i(θ) φ_i(τ) = θ^p/γ(τ).

use partita_integrate::tableau::{ErrorWeights, Tableau, METHODS};

/// Coefficients of up to 530 (the septic of DOP853) with 16 digits, summed over 16 stages.
const ROUND_OFF: f64 = 2e-12;
/// A condition that is meant to fail fails by more than this.
const VISIBLE: f64 = 1e-7;

struct Tree {
    order: usize,
    density: f64,
    children: Vec<usize>,
}

/// All rooted trees up to `highest` vertices, smaller ones first.
fn rooted_trees(highest: usize) -> Vec<Tree> {
    let mut trees = vec![Tree { order: 1, density: 1.0, children: vec![] }];
    for order in 2..=highest {
        let mut forests = vec![];
        collect_forests(&trees, order - 1, 0, &mut vec![], &mut forests);
        for children in forests {
            let density = children.iter().fold(order as f64, |g, &child| g * trees[child].density);
            trees.push(Tree { order, density, children });
        }
    }
    trees
}

/// Multisets of known trees with `vertices` vertices together, each as a rising list of indices.
fn collect_forests(trees: &[Tree], vertices: usize, from: usize, chosen: &mut Vec<usize>, out: &mut Vec<Vec<usize>>) {
    if vertices == 0 {
        out.push(chosen.clone());
    }
    for tree in from..trees.len() {
        if trees[tree].order <= vertices {
            chosen.push(tree);
            collect_forests(trees, vertices - trees[tree].order, tree, chosen, out);
            chosen.pop();
        }
    }
}

/// The method with one row for each slot: its stages, the slope at the end, the stages of dense output.
struct Slots {
    a: Vec<Vec<f64>>,
    c: Vec<f64>,
    b: Vec<f64>,
    end: usize,
}

fn slots(method: &Tableau) -> Slots {
    let n = method.slots();
    let pad = |row: &[f64]| {
        let mut row = row.to_vec();
        row.resize(n, 0.0);
        row
    };
    let mut a: Vec<_> = method.a.iter().map(|row| pad(row)).collect();
    let mut c = method.c.to_vec();
    if !method.fsal {
        a.push(pad(method.b));
        c.push(1.0);
    }
    a.extend(method.dense.a.iter().map(|row| pad(row)));
    c.extend(method.dense.nodes);
    Slots { a, c, b: pad(method.b), end: method.end_slot() }
}

/// φ_i(τ) for every tree and slot.
fn elementary_weights(trees: &[Tree], a: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut phi: Vec<Vec<f64>> = vec![];
    for tree in trees {
        let weight = |row: &Vec<f64>| tree.children.iter().map(|&child| dot(row, &phi[child])).product::<f64>();
        phi.push(a.iter().map(weight).collect());
    }
    phi
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// Largest violation of `Σ w_i φ_i = target` over the trees with `orders` vertices.
fn violation(
    method: &Tableau,
    weights: &[f64],
    orders: std::ops::RangeInclusive<usize>,
    target: impl Fn(&Tree) -> f64,
) -> f64 {
    let trees = rooted_trees(*orders.end());
    let phi = elementary_weights(&trees, &slots(method).a);
    let of_order = trees.iter().zip(&phi).filter(|(tree, _)| orders.contains(&tree.order));
    of_order.map(|(tree, phi)| (dot(weights, phi) - target(tree)).abs()).fold(0.0, f64::max)
}

/// b_i(θ), from the nested form that dense output is written in.
fn dense_weights(method: &Tableau, theta: f64) -> Vec<f64> {
    let s = slots(method);
    let n = s.b.len();
    let unit = |slot: usize| (0..n).map(move |i| if i == slot { 1.0 } else { 0.0 });
    let mut f: Vec<Vec<f64>> = vec![
        s.b.clone(),
        unit(0).zip(&s.b).map(|(first, b)| first - b).collect(),
        unit(0).zip(unit(s.end)).zip(&s.b).map(|((first, end), b)| 2.0 * b - first - end).collect(),
    ];
    f.extend(method.dense.weights.iter().map(|row| row.to_vec()));
    let mut sum = vec![0.0; n];
    for (j, f) in f.iter().enumerate().rev() {
        let factor = if j % 2 == 0 { 1.0 - theta } else { theta };
        sum.iter_mut().zip(f).for_each(|(sum, f)| *sum = f + factor * *sum);
    }
    sum.iter().map(|x| theta * x).collect()
}

#[test]
fn there_are_as_many_rooted_trees_as_cayley_counted() {
    let trees = rooted_trees(8);
    let count = |order| trees.iter().filter(|tree| tree.order == order).count();
    assert_eq!((1..=8).map(count).collect::<Vec<_>>(), [1, 1, 2, 4, 9, 20, 48, 115]);
}

#[test]
fn shapes_fit_together() {
    for method in METHODS {
        let s = method.stages;
        assert_eq!((method.a.len(), method.b.len(), method.c.len()), (s, s, s), "{}", method.name);
        for (i, row) in method.a.iter().enumerate() {
            assert_eq!(row.len(), i, "{}", method.name);
        }
        for (i, row) in method.dense.a.iter().enumerate() {
            assert_eq!(row.len(), method.end_slot() + 1 + i, "{}", method.name);
        }
        for row in method.dense.weights {
            assert_eq!(row.len(), method.slots(), "{}", method.name);
        }
        if method.fsal {
            assert_eq!(method.a[s - 1], &method.b[..s - 1], "{}", method.name);
            assert_eq!((method.b[s - 1], method.c[s - 1]), (0.0, 1.0), "{}", method.name);
        }
    }
}

#[test]
fn rows_sum_to_nodes_and_weights_to_one() {
    for method in METHODS {
        let s = slots(method);
        for (row, c) in s.a.iter().zip(&s.c) {
            let sum = row.iter().sum::<f64>();
            assert!((sum - c).abs() < 2e-14, "{}: {sum} is not {c}", method.name);
        }
        assert!((s.b.iter().sum::<f64>() - 1.0).abs() < 1e-14, "{}", method.name);
    }
}

#[test]
fn steps_have_exactly_the_order_on_the_label() {
    for method in METHODS {
        let (p, b) = (method.order, slots(method).b);
        let exact = |tree: &Tree| 1.0 / tree.density;
        let within = violation(method, &b, 1..=p, exact);
        assert!(within < ROUND_OFF, "{}: {within:e}", method.name);
        assert!(violation(method, &b, p + 1..=p + 1, exact) > VISIBLE, "{}", method.name);
    }
}

#[test]
fn error_estimates_have_exactly_their_order() {
    let check = |method: &Tableau, weights: &[f64], order: usize| {
        let zero = |_: &Tree| 0.0;
        let within = violation(method, weights, 1..=order, zero);
        assert!(within < ROUND_OFF, "{}: {within:e}", method.name);
        let next = violation(method, weights, order + 1..=order + 1, zero);
        assert!(next > VISIBLE, "{}: {next:e}", method.name);
    };
    for method in METHODS {
        match &method.error {
            ErrorWeights::None => assert_eq!(method.error_order, 0),
            ErrorWeights::One(weights) => check(method, weights, method.error_order),
            ErrorWeights::FifthAndThird { fifth, third } => {
                check(method, fifth, 5);
                check(method, third, 3);
                // ‖E5‖² / sqrt(‖E5‖² + 0.01 ‖E3‖²) shrinks like h^(2·6 − 4)
                assert_eq!(method.error_order + 1, 2 * 6 - 4);
            }
        }
    }
}

#[test]
fn dense_output_has_exactly_the_order_on_the_label() {
    for method in METHODS {
        let d = method.dense.order;
        let mut next = 0.0_f64;
        for i in 0..=10 {
            let theta = f64::from(i) / 10.0;
            let weights = dense_weights(method, theta);
            let exact = |tree: &Tree| theta.powi(tree.order as i32) / tree.density;
            let within = violation(method, &weights, 1..=d, exact);
            assert!(within < ROUND_OFF, "{} at θ = {theta}: {within:e}", method.name);
            next = next.max(violation(method, &weights, d + 1..=d + 1, exact));
        }
        assert!(next > VISIBLE, "{}", method.name);
    }
}
