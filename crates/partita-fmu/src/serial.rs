//! Lists of numbers as bytes: what a saved state of an FMU is outside of the program.

const MARK: &[u8] = b"partita fmu state 2";

/// The lists, after a mark and the name of the model.
pub fn bytes(guid: &str, lists: &[&[f64]]) -> Vec<u8> {
    let mut found = MARK.to_vec();
    let count = |found: &mut Vec<u8>, n: usize| found.extend((n as u64).to_le_bytes());
    count(&mut found, guid.len());
    found.extend(guid.as_bytes());
    for list in lists {
        count(&mut found, list.len());
        found.extend(list.iter().flat_map(|x| x.to_le_bytes()));
    }
    found
}

/// The lists in bytes of this model; `None` for any other bytes.
pub fn lists(guid: &str, bytes: &[u8]) -> Option<Vec<Vec<f64>>> {
    let mut rest = bytes.strip_prefix(MARK)?;
    let mut taken = |n: usize| {
        let (head, tail) = rest.split_at_checked(n)?;
        rest = tail;
        Some((head, tail.is_empty()))
    };
    let number = |x: &[u8]| Some(u64::from_le_bytes(x.try_into().ok()?));
    let name = usize::try_from(number(taken(8)?.0)?).ok()?;
    let (own, mut ended) = taken(name)?;
    if own != guid.as_bytes() {
        return None;
    }
    let mut found = Vec::new();
    while !ended {
        let count = usize::try_from(number(taken(8)?.0)?).ok()?;
        let (list, last) = taken(count.checked_mul(8)?)?;
        let values = list.chunks_exact(8).map(|x| Some(f64::from_le_bytes(x.try_into().ok()?)));
        found.push(values.collect::<Option<Vec<_>>>()?);
        ended = last;
    }
    Some(found)
}
