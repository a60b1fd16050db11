//! Painting of pictures and sheets of a scene.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::camera::Camera;
use super::caster::{Caster, Hit};
use super::panel::{Panel, Picture};
use super::shading::{Appearance, BEAD, GROUND, HOUSING, Plane, Sample, Scenery, colour_of};
use super::{Cut, Direction, Fan, Orbit, Selection, ViewError, annotate};
use crate::anatomy::{Axes, Mesh, Scene};
use crate::transducer::housing;

/// Largest number of pixels in a picture. Each takes about 70 bytes while it is painted.
pub const PIXELS_MAX: u32 = 1 << 24;

/// Size, direction and cut of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PictureSettings {
    /// Width, pixels, 64..=8192. Width times height is at most [`PIXELS_MAX`].
    pub width: u32,
    /// Height, pixels, 64..=8192.
    pub height: u32,
    /// Viewing direction.
    pub from: Direction,
    /// Rotation of the viewer from that direction.
    pub orbit: Orbit,
    /// Cut through the scene, if any.
    pub cut: Option<Cut>,
}

/// A scene that is prepared for pictures.
pub struct SceneView {
    scenery: Scenery,
    tissue_names: Vec<String>,
    /// Corners of the bounding box of everything that is shown, mm.
    corners_mm: Vec<DVec3>,
    /// Corners of the probe's housing and points of its fan's outline, mm; empty without a probe.
    probe_mm: Vec<DVec3>,
    axes: Axes,
}

impl SceneView {
    /// Prepares the surfaces of `scene` that `selection` shows, and the probe if there is one.
    pub fn new(scene: &Scene, selection: &Selection, fan: Option<Fan>, axes: Axes) -> Self {
        let shown: Vec<usize> = (0..scene.surfaces.len()).filter(|&i| selection.shown.get(i) == Some(&true)).collect();
        let meshes: Vec<&Mesh> = shown.iter().filter_map(|&i| scene.surfaces.get(i)).map(|s| &s.mesh).collect();
        let opacities = selection.opacities(scene, &shown);
        let mut appearances = Vec::new();
        let mut corners_mm = Vec::new();
        for (&index, opacity) in shown.iter().zip(opacities) {
            let Some(surface) = scene.surfaces.get(index) else { continue };
            let name = scene.tissues.names().get(surface.tissue).map_or("", String::as_str);
            appearances.push(Appearance { colour: colour_of(name), opacity, tissue: Some(surface.tissue) });
            let bounds = surface.mesh.bounds_mm().map(|b| [b.min.as_dvec3(), b.max.as_dvec3()]);
            corners_mm.extend(
                bounds
                    .into_iter()
                    .flat_map(|b| (0..8).map(move |i| DVec3::new(b[i & 1].x, b[(i >> 1) & 1].y, b[i >> 2].z))),
            );
        }
        let housing = fan.as_ref().map(|fan| housing(&fan.probe, &fan.scene_from_probe));
        let mut probe_mm: Vec<DVec3> = fan.iter().flat_map(Fan::outline_mm).collect();
        for mesh in housing.iter().flatten() {
            probe_mm.extend(mesh.vertices_mm.iter().map(|v| v.as_dvec3()));
        }
        corners_mm.extend(&probe_mm);
        if fan.is_some() {
            appearances.push(Appearance { colour: HOUSING, opacity: 1.0, tissue: None });
            appearances.push(Appearance { colour: BEAD, opacity: 1.0, tissue: None });
        }
        let caster = Caster::new((0u32..).zip(meshes.iter().copied().chain(housing.iter().flatten())));
        let scenery = Scenery { caster, appearances, fan };
        Self { scenery, tissue_names: scene.tissues.names().to_vec(), corners_mm, probe_mm, axes }
    }

    /// A picture with legend, scale and axes.
    ///
    /// # Errors
    /// The size is out of range; or direction or cut needs a probe, and there is none.
    pub fn picture(&self, settings: &PictureSettings) -> Result<Picture, ViewError> {
        let &PictureSettings { width, height, .. } = settings;
        check_size(width, height)?;
        let legend = annotate::legend_width(width);
        let panel = self.panel(settings, (width - legend, height), settings.from == Direction::Fan)?;
        let mut canvas = annotate::canvas(width, height);
        annotate::draw_panel(&mut canvas, (0, 0), &panel, self.axes);
        annotate::legend(&mut canvas, width - legend, &self.names(&panel.seen));
        Ok(annotate::picture(&canvas))
    }

    /// Four panels in one picture: from the front, the left, the top, and onto the fan; without a probe, the fourth
    /// is from behind.
    ///
    /// # Errors
    /// The size is out of range; or the cut is at the fan, and there is no probe.
    pub fn sheet(&self, settings: &PictureSettings) -> Result<Picture, ViewError> {
        let &PictureSettings { width, height, .. } = settings;
        check_size(width, height)?;
        let legend = annotate::legend_width(width);
        let (w, h) = ((width - legend) / 2, height / 2);
        let last = if self.scenery.fan.is_some() { Direction::Fan } else { Direction::Back };
        let titles = match self.axes {
            Axes::Depth => ["front", "from +x", "from above", "onto the fan"],
            Axes::Anatomical | Axes::Patient => ["anterior", "left", "cranial", "onto the fan"],
        };
        let panels = [Direction::Front, Direction::Left, Direction::Top, last];
        let mut canvas = annotate::canvas(width, height);
        let mut seen = [0; 4];
        for (i, (from, title)) in (0u32..).zip(panels.into_iter().zip(titles)) {
            // The panel of the fan is cut at the fan by default, to show the section that the probe sees.
            let cut = if from == Direction::Fan { settings.cut.or(Some(Cut::Fan)) } else { settings.cut };
            let one = PictureSettings { from, orbit: Orbit::default(), cut, ..*settings };
            let panel = self.panel(&one, (w - 4, h - 4), from == Direction::Fan)?;
            let title = if i == 3 && self.scenery.fan.is_none() { "from behind" } else { title };
            seen.iter_mut().zip(panel.seen).for_each(|(all, one)| *all |= one);
            let at = (i % 2 * w + 2, i / 2 * h + 2);
            annotate::draw_panel(&mut canvas, at, &panel, self.axes);
            annotate::title(&mut canvas, at, title);
        }
        annotate::legend(&mut canvas, width - legend, &self.names(&seen));
        Ok(annotate::picture(&canvas))
    }

    /// Names of the tissues whose bits are set in `seen`.
    fn names(&self, seen: &[u64; 4]) -> Vec<&str> {
        let set = |i: usize| seen.get(i >> 6).is_some_and(|word| word >> (i & 63) & 1 == 1);
        self.tissue_names.iter().enumerate().filter(|(i, _)| set(*i)).map(|(_, name)| name.as_str()).collect()
    }

    /// One projection of `size` pixels. If `close`, it shows only the fan and its surroundings.
    fn panel(&self, settings: &PictureSettings, size: (u32, u32), close: bool) -> Result<Panel, ViewError> {
        let pose = self.scenery.fan.as_ref().map(|fan| fan.scene_from_probe);
        let what = if settings.from == Direction::Probe { "--from probe" } else { "--from fan" };
        let camera = Camera::new(settings.from, settings.orbit, self.axes, pose);
        let mut camera = camera.ok_or(ViewError::NoFan { what })?;
        let outline = self.scenery.fan.as_ref().map(Fan::outline_mm).unwrap_or_default();
        let shown = if close && !self.probe_mm.is_empty() { &self.probe_mm } else { &self.corners_mm };
        camera.fit(shown, (0.0, 0.0), (f64::from(size.0), f64::from(size.1)));
        let plane = self.plane(settings.cut, &camera)?;

        let (width, height) = (size.0 as usize, size.1 as usize);
        let sample_at = |column: f64, row: f64, hits: &mut Vec<Hit>| {
            self.scenery.sample(&camera, plane.as_ref(), column, row, hits)
        };
        let row = |(row, out): (usize, &mut [Sample])| {
            let mut hits = Vec::new();
            for (column, sample) in out.iter_mut().enumerate() {
                *sample = sample_at(column as f64 + 0.5, row as f64 + 0.5, &mut hits);
            }
        };
        let mut first: Vec<Sample> = vec![Sample { colour: GROUND, seen: [0; 4], layers: 0 }; width * height];
        first.par_chunks_mut(width).enumerate().for_each(row);
        let smooth = |(index, out): (usize, &mut Vec3)| {
            let (column, row) = (index % width, index / width);
            let here = first[index];
            let differs = |other: usize| first[other].layers != here.layers;
            *out = here.colour;
            let edge = (column > 0 && differs(index - 1))
                || (column + 1 < width && differs(index + 1))
                || (row > 0 && differs(index - width))
                || (row + 1 < height && differs(index + width));
            if edge {
                let mut hits = Vec::new();
                // Offsets of four samples in a pixel: the corners of a rotated square.
                let offsets = [(0.375, 0.125), (0.875, 0.375), (0.625, 0.875), (0.125, 0.625)];
                let colours = offsets.map(|(x, y)| sample_at(column as f64 + x, row as f64 + y, &mut hits).colour);
                let sum: Vec3 = colours.into_iter().sum();
                *out = 0.25 * sum;
            }
        };
        let mut colours = vec![GROUND; width * height];
        colours.par_iter_mut().enumerate().for_each(smooth);
        let seen = first.iter().fold([0; 4], |mut all, sample| {
            all.iter_mut().zip(sample.seen).for_each(|(all, one)| *all |= one);
            all
        });
        let rgb =
            colours.iter().flat_map(|c| (c.clamp(Vec3::ZERO, Vec3::ONE) * 255.0 + 0.5).to_array()).map(|v| v as u8);
        Ok(Panel { width: size.0, height: size.1, rgb: rgb.collect(), seen, camera, outline })
    }

    /// Plane of a cut, with its normal towards the viewer; `None` if it is seen edge-on.
    fn plane(&self, cut: Option<Cut>, camera: &Camera) -> Result<Option<Plane>, ViewError> {
        let (point_mm, normal) = match cut {
            None => return Ok(None),
            Some(Cut::Fan) => {
                let fan = self.scenery.fan.as_ref().ok_or(ViewError::NoFan { what: "--cut fan" })?;
                (fan.scene_from_probe.position_mm, fan.scene_from_probe.orientation * DVec3::Y)
            }
            Some(Cut::Axis(axis, at_mm)) => {
                let normal = DVec3::AXES[axis.min(2)];
                (normal * at_mm, normal)
            }
        };
        let slope = normal.dot(camera.forward);
        if slope.abs() < 1e-3 {
            return Ok(None);
        }
        Ok(Some(Plane { point_mm, normal: if slope > 0.0 { -normal } else { normal } }))
    }
}

fn check_size(width: u32, height: u32) -> Result<(), ViewError> {
    let good = 64..=8192;
    // The product of two sides in range can't overflow.
    let fits = good.contains(&width) && good.contains(&height) && width * height <= PIXELS_MAX;
    if fits { Ok(()) } else { Err(ViewError::Size { width, height }) }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::super::BmodeImage;
    use super::*;
    use crate::anatomy::TissueTable;
    use crate::anatomy::analytic::{Part, cuboid, scene, sphere};
    use crate::pose::Pose;
    use crate::transducer::{Probe, Sector};

    fn block_and_ball() -> Scene {
        let block = cuboid(Vec3::splat(-300.0), Vec3::splat(300.0));
        let ball = sphere(Vec3::new(-200.0, 0.0, 200.0), 30.0, 3);
        let part = |name, tissue, priority, mesh| Part { name, tissue, priority, mesh };
        scene(
            vec![part("block", "liver", 1, block), part("ball", "bone_adult", 2, ball)],
            &TissueTable::builtin().unwrap(),
            "gel",
        )
        .unwrap()
    }

    fn fan(x: f64, image: Option<BmodeImage>) -> Fan {
        let orientation = DQuat::from_rotation_z(0.2);
        let scene_from_probe = Pose { position_mm: DVec3::new(x, 0.0, 0.0), orientation };
        Fan { scene_from_probe, probe: Probe::default(), image }
    }

    fn settings() -> PictureSettings {
        let orbit = Orbit { azimuth_deg: 20.0, elevation_deg: 10.0 };
        PictureSettings { width: 400, height: 300, from: Direction::Front, orbit, cut: None }
    }

    fn pixel(panel: &Panel, point: DVec3) -> [i32; 3] {
        let (column, row) = panel.camera.pixel(point);
        let at = 3 * (row as usize * panel.width as usize + column as usize);
        [0, 1, 2].map(|i| i32::from(panel.rgb[at + i]))
    }

    #[test]
    fn the_fan_is_where_the_pose_says() {
        let scene = block_and_ball();
        let panel = |fan| {
            SceneView::new(&scene, &Selection::all(&scene), fan, Axes::Depth).panel(&settings(), (400, 300), false)
        };
        let without = panel(None).unwrap();
        for x in [-60.0, 0.0, 80.0] {
            let fan = fan(x, None);
            let inside = [(0.0, 20.0), (30.0, 70.0), (-40.0, 120.0), (0.0, 148.0)];
            let outside = [(-80.0, 40.0), (80.0, 40.0), (0.0, 160.0)];
            let there = panel(Some(fan.clone())).unwrap();
            let amber = |(across, depth): (f64, f64)| {
                let point = fan.scene_from_probe.transform_point(DVec3::new(across, 0.0, depth));
                let (with, without) = (pixel(&there, point), pixel(&without, point));
                // Amber is redder than its background.
                (with[0] - with[2]) - (without[0] - without[2])
            };
            // The framing differs, but the block fills both pictures with one colour.
            assert!(inside.iter().all(|&p| amber(p) > 15), "{:?}", inside.map(amber));
            assert!(outside.iter().all(|&p| amber(p).abs() < 6), "{:?}", outside.map(amber));
        }
    }

    #[test]
    fn an_image_lies_in_the_fan_as_it_was_taken() {
        let scene = block_and_ball();
        let sector = Sector::fit(&Probe::default(), 200, 150);
        // White left of the image's middle.
        let grey = (0..200 * 150).map(|i| if i % 200 < 100 { 255 } else { 0 }).collect();
        let fan = fan(0.0, Some(BmodeImage { sector, grey }));
        let pose = fan.scene_from_probe;
        let only = Selection::of(&scene, &["ball".into()], &[]).unwrap();
        let panel =
            SceneView::new(&scene, &only, Some(fan), Axes::Depth).panel(&settings(), (400, 300), false).unwrap();
        let at = |x: f64| pixel(&panel, pose.transform_point(DVec3::new(x, 0.0, 80.0)));
        assert!(at(-20.0)[1] > 200 && at(20.0)[1] < 40, "{:?} {:?}", at(-20.0), at(20.0));
    }

    #[test]
    fn hidden_surfaces_vanish_and_a_cut_shows_the_section() {
        let scene = block_and_ball();
        let centre = DVec3::new(-200.0, 0.0, 200.0);
        let look = |only: &[&str], hide: &[&str], cut| {
            let names = |names: &[&str]| names.iter().map(|&n| n.to_owned()).collect::<Vec<_>>();
            let selection = Selection::of(&scene, &names(only), &names(hide)).unwrap();
            let view = SceneView::new(&scene, &selection, None, Axes::Depth);
            let panel = view.panel(&PictureSettings { cut, ..settings() }, (400, 300), false).unwrap();
            (pixel(&panel, centre), view.names(&panel.seen).join(" "))
        };
        let ground = GROUND.to_array().map(|v| (v * 255.0 + 0.5) as i32);
        let (ball, names) = look(&["bone_adult"], &[], None);
        assert!(ball != ground && names == "bone_adult", "{names}");
        let (block, names) = look(&[], &["ball"], None);
        assert!(block != ball && names == "liver", "{names}");
        // The section shows the surface with the highest priority, in a flat colour.
        let bone = (0.92 * colour_of("bone_adult")).to_array().map(|v| (v * 255.0 + 0.5) as i32);
        assert_eq!(look(&[], &[], Some(Cut::Axis(1, 0.0))).0, bone);
        assert!(look(&["block"], &[], Some(Cut::Axis(1, 0.0))).0 != bone);
        assert_eq!(look(&["ball"], &[], Some(Cut::Axis(1, -50.0))).0, ground, "the ball lies before that plane");
        let unknown = Selection::of(&scene, &[], &["bal".into()]).unwrap_err();
        assert!(unknown.to_string().contains("did you mean `ball`"), "{unknown}");
        assert_eq!(Selection::of(&scene, &[], &["ball".into(), "liver".into()]), Err(ViewError::NothingLeft));
    }

    #[test]
    fn pictures_that_cannot_be_made_are_refused() {
        let scene = block_and_ball();
        let view = SceneView::new(&scene, &Selection::all(&scene), None, Axes::Depth);
        let with = |from, cut, width| view.picture(&PictureSettings { from, cut, width, ..settings() });
        assert!(matches!(with(Direction::Fan, None, 400), Err(ViewError::NoFan { .. })));
        assert!(matches!(with(Direction::Front, Some(Cut::Fan), 400), Err(ViewError::NoFan { .. })));
        assert!(matches!(with(Direction::Front, None, 20), Err(ViewError::Size { .. })));
        let large = view.picture(&PictureSettings { width: 8192, height: 2049, ..settings() });
        assert!(large.unwrap_err().to_string().contains("16777216 in all"));
        let sheet = view.sheet(&PictureSettings { width: 900, height: 640, ..settings() }).unwrap();
        assert_eq!(sheet.rgb.len(), 900 * 640 * 3);
    }
}
