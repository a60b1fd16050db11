use insonify::anatomy::phantom::*;
use std::collections::HashMap;
use std::time::Instant;
fn main() {
    let scale: f64 = std::env::args().nth(1).unwrap().parse().unwrap();
    let t = Instant::now();
    let all = organs();
    let by: HashMap<&str, &Organ> = all.iter().map(|o| (o.name, o)).collect();
    let s = build(&PhantomOptions { scale }, &|_| {}).unwrap();
    println!("build {:?}", t.elapsed());
    for x in &s {
        let o = by[x.name.as_str()];
        let m = &x.mesh;
        let mut e: HashMap<(u32, u32), i32> = HashMap::new();
        for t in &m.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *e.entry((a, b)).or_default() += 1;
            }
        }
        let open = e.iter().filter(|&(&(a, b), &n)| n != 1 || e.get(&(b, a)) != Some(&1)).count();
        let worst = m.vertices_mm.iter().map(|&v| o.solid.distance_mm(v).abs()).fold(0.0, f32::max);
        let off = m.vertices_mm.iter().filter(|&&v| o.solid.distance_mm(v).abs() > 0.05).count();
        let area: f32 = m.corners_mm().map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length()).sum();
        let h = (3.0 * area / m.triangles.len() as f32).sqrt();
        let mut f = 0; // folded triangles
        for [a, b, c] in m.corners_mm() {
            let n = (b - a).cross(c - a);
            if n.length() > 1e-6 && n.dot(o.solid.normal((a + b + c) / 3.0)) < 0.0 {
                f += 1;
            }
        }
        println!(
            "{:24} {:20} {:4} tris {:6} vol {:10.0} cell~{:.2}/{:.2} open {} worst {:.3} off {} folded {}",
            x.name,
            x.tissue,
            x.priority,
            m.triangles.len(),
            m.signed_volume_mm3(),
            h,
            o.grain_mm,
            open,
            worst,
            off,
            f
        );
    }
    for (body, pick) in [("mother", Body::Mother), ("fetus", Body::Fetus)] {
        let n: usize = s.iter().filter(|x| by[x.name.as_str()].body == pick).map(|x| x.mesh.triangles.len()).sum();
        println!("{body} {n}");
    }
    let get = |n: &str| s.iter().find(|x| x.name == n).unwrap();
    let cav = &by["amniotic_cavity"].solid;
    let pl = &by["placenta"].solid;
    let cord = &by["cord"].solid;
    let skin = &by["fetal_skin"].solid;
    let f = get("fetal_skin");
    let (w, at) = f
        .mesh
        .vertices_mm
        .iter()
        .map(|&v| (cav.distance_mm(v), v))
        .fold((-1e9, Default::default()), |a: (f32, glam::Vec3), b| if b.0 > a.0 { b } else { a });
    println!("fetus to wall {w:.2} at {at}");
    let mut bad: Vec<_> = f.mesh.vertices_mm.iter().filter(|&&v| cav.distance_mm(v) > -1.5).collect();
    bad.sort_by(|a, b| a.x.total_cmp(&b.x));
    println!("  {} near the wall: {:?}", bad.len(), bad.iter().step_by((bad.len() / 12).max(1)).collect::<Vec<_>>());
    let mut bad: Vec<_> = f.mesh.vertices_mm.iter().filter(|&&v| pl.distance_mm(v) < 1.5).collect();
    bad.sort_by(|a, b| a.x.total_cmp(&b.x));
    let w = f.mesh.vertices_mm.iter().map(|&v| pl.distance_mm(v)).fold(1e9, f32::min);
    println!(
        "fetus to placenta {w:.2}; {} near: {:?}",
        bad.len(),
        bad.iter().step_by((bad.len() / 12).max(1)).collect::<Vec<_>>()
    );
    let c = get("cord");
    let mut bad: Vec<_> = c.mesh.vertices_mm.iter().filter(|&&v| cav.distance_mm(v) > -0.5).collect();
    bad.sort_by(|a, b| a.x.total_cmp(&b.x));
    println!("cord at wall {}: {:?}", bad.len(), bad.iter().step_by((bad.len() / 12).max(1)).collect::<Vec<_>>());
    let mut bad: Vec<_> = c.mesh.vertices_mm.iter().filter(|&&v| skin.distance_mm(v) < 0.3).collect();
    bad.sort_by(|a, b| a.x.total_cmp(&b.x));
    println!("cord in fetus {}: {:?}", bad.len(), bad.iter().step_by((bad.len() / 24).max(1)).collect::<Vec<_>>());
    let mut bad: Vec<_> = f.mesh.vertices_mm.iter().filter(|&&v| cord.distance_mm(v) < 0.3).collect();
    bad.sort_by(|a, b| a.x.total_cmp(&b.x));
    println!("fetus in cord {}", bad.len());
    // volumes
    println!("{:#?}", landmarks());
}
