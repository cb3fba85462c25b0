//! Matching of rows to joints, and strongly connected sets of joints.

/// One joint for each row, by augmenting paths that try large entries first \[K55\].
pub(super) fn matching(sees: &[Vec<bool>], size: impl Fn(usize, usize) -> f64) -> Vec<usize> {
    let m = sees.len();
    let mut row_of: Vec<Option<usize>> = vec![None; m];
    fn augment(
        i: usize,
        order: &[Vec<usize>],
        row_of: &mut [Option<usize>],
        tried: &mut [bool],
    ) -> bool {
        for &a in &order[i] {
            if !tried[a] {
                tried[a] = true;
                if row_of[a].is_none_or(|other| augment(other, order, row_of, tried)) {
                    row_of[a] = Some(i);
                    return true;
                }
            }
        }
        false
    }
    let order: Vec<Vec<usize>> = (0..m)
        .map(|i| {
            let mut columns: Vec<usize> = (0..m).filter(|a| sees[i][*a]).collect();
            columns.sort_by(|a, b| size(i, *b).total_cmp(&size(i, *a)));
            columns
        })
        .collect();
    for i in 0..m {
        augment(i, &order, &mut row_of, &mut vec![false; m]);
    }
    let mut matched = vec![0; m];
    for (a, row) in row_of.iter().enumerate() {
        if let Some(i) = row {
            matched[*i] = a;
        }
    }
    matched
}

/// Tarjan's strongly connected components \[T72\]; a component comes after all that it needs.
pub(super) fn strongly_connected(n: usize, needs: impl Fn(usize) -> Vec<usize>) -> Vec<Vec<usize>> {
    struct Walk {
        number: Vec<usize>,
        low: Vec<usize>,
        on_stack: Vec<bool>,
        stack: Vec<usize>,
        next: usize,
        sets: Vec<Vec<usize>>,
    }
    fn visit(a: usize, needs: &dyn Fn(usize) -> Vec<usize>, walk: &mut Walk) {
        walk.number[a] = walk.next;
        walk.low[a] = walk.next;
        walk.next += 1;
        walk.stack.push(a);
        walk.on_stack[a] = true;
        for b in needs(a) {
            if walk.number[b] == usize::MAX {
                visit(b, needs, walk);
                walk.low[a] = walk.low[a].min(walk.low[b]);
            } else if walk.on_stack[b] {
                walk.low[a] = walk.low[a].min(walk.number[b]);
            }
        }
        if walk.low[a] == walk.number[a] {
            let mut set = Vec::new();
            while let Some(b) = walk.stack.pop() {
                walk.on_stack[b] = false;
                set.push(b);
                if b == a {
                    break;
                }
            }
            set.sort_unstable();
            walk.sets.push(set);
        }
    }
    let mut walk = Walk {
        number: vec![usize::MAX; n],
        low: vec![0; n],
        on_stack: vec![false; n],
        stack: Vec::new(),
        next: 0,
        sets: Vec::new(),
    };
    for a in 0..n {
        if walk.number[a] == usize::MAX {
            visit(a, &needs, &mut walk);
        }
    }
    walk.sets
}
