//! Names in an order for people.

/// Order of names in which numbers count as numbers: `[2]` before `[10]`.
pub fn natural(a: &str, b: &str) -> std::cmp::Ordering {
    let (mut a, mut b) = (a.as_bytes(), b.as_bytes());
    loop {
        let digits = |s: &[u8]| s.iter().take_while(|c| c.is_ascii_digit()).count();
        let (m, n) = (digits(a), digits(b));
        if m > 0 && n > 0 {
            let value = |s: &[u8]| {
                s.iter().fold(0u128, |v, c| {
                    v.saturating_mul(10).saturating_add(u128::from(c - b'0'))
                })
            };
            let order = value(&a[..m]).cmp(&value(&b[..n])).then(m.cmp(&n));
            if order.is_ne() {
                return order;
            }
            (a, b) = (&a[m..], &b[n..]);
        } else {
            match (a.first(), b.first()) {
                (Some(x), Some(y)) if x == y => (a, b) = (&a[1..], &b[1..]),
                (x, y) => return x.cmp(&y),
            }
        }
    }
}
