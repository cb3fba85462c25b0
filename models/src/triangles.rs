//! Triangles of STL and OBJ files, whose coordinates have single precision.

/// The corners of a triangle.
pub type Triangle = [[f64; 3]; 3];

/// Of a binary STL; none where it is cut off or a number is not finite.
pub fn binary_stl(bytes: &[u8]) -> Option<Vec<Triangle>> {
    let count = u32::from_le_bytes(*bytes.get(80..84)?.first_chunk()?) as usize;
    let body = bytes.get(84..84 + 50 * count)?;
    let number = |of: &[u8; 4]| f64::from(f32::from_le_bytes(*of));
    let triangle = |of: &[u8; 50]| {
        let numbers: Vec<f64> = of[12..48].as_chunks().0.iter().map(number).collect();
        [0, 3, 6].map(|k| [numbers[k], numbers[k + 1], numbers[k + 2]])
    };
    finite(body.as_chunks().0.iter().map(triangle).collect())
}

/// Of an OBJ; a face of more corners is a fan.
pub fn obj(bytes: &[u8]) -> Option<Vec<Triangle>> {
    let mut points: Vec<[f64; 3]> = Vec::new();
    let mut triangles = Vec::new();
    for line in String::from_utf8_lossy(bytes).lines() {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let mut number = || Some(f64::from(words.next()?.parse::<f32>().ok()?));
                let point = [number()?, number()?, number()?];
                points.push(point);
            }
            Some("f") => {
                let corner = |word: &str| {
                    let index: i64 = word.split('/').next()?.parse().ok()?;
                    // negative ones count from the end
                    let from = if index < 0 { points.len() as i64 + index } else { index - 1 };
                    points.get(usize::try_from(from).ok()?).copied()
                };
                let corners = words.map(corner).collect::<Option<Vec<_>>>()?;
                let (first, rest) = corners.split_first()?;
                triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
            }
            _ => {}
        }
    }
    finite(triangles)
}

fn finite(triangles: Vec<Triangle>) -> Option<Vec<Triangle>> {
    triangles.as_flattened().as_flattened().iter().all(|x| x.is_finite()).then_some(triangles)
}
