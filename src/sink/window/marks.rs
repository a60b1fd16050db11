//! Marks over the picture: depth scale, focus, states, figures, keys.
//!
//! They are drawn on the CPU into a canvas of the window's size, only when a mark changes. Black is transparent.

use crate::pose::TrackingState;
use crate::presented::FrameSource;
use crate::settings::{Display, hot_keys};
use crate::sink::canvas::{Canvas, Text};
use crate::sink::colour::Rgb;

use super::sink::Shown;

const INK: Rgb = [214, 221, 227];
const FAINT: Rgb = [125, 136, 147];
const ACCENT: Rgb = [79, 209, 197];
const WARN: Rgb = [245, 184, 61];
const BAD: Rgb = [201, 48, 42];
const COLD: Rgb = [125, 183, 255];
const PANEL: Rgb = [14, 19, 24];
/// Almost black, because black is transparent.
const DARK: Rgb = [12, 10, 2];

const MARGIN_X: f32 = 70.0;
const MARGIN_TOP: f32 = 44.0;
const MARGIN_BOTTOM: f32 = 34.0;

/// Rectangle of the picture in a window, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Placement {
    pub(super) x: f32,
    pub(super) y: f32,
    pub(super) width: f32,
    pub(super) height: f32,
}

/// Largest rectangle of the picture's proportions within the window's margins, centred.
pub(super) fn placement(image: (u32, u32), window: (u32, u32)) -> Placement {
    let (w, h) = (image.0.max(1) as f32, image.1.max(1) as f32);
    let room_x = (window.0 as f32 - 2.0 * MARGIN_X).max(1.0);
    let room_y = (window.1 as f32 - MARGIN_TOP - MARGIN_BOTTOM).max(1.0);
    let scale = (room_x / w).min(room_y / h);
    let (width, height) = (w * scale, h * scale);
    Placement { x: MARGIN_X + 0.5 * (room_x - width), y: MARGIN_TOP + 0.5 * (room_y - height), width, height }
}

/// Distance between numbered ticks, cm, chosen for at least 26 pixels between numbers.
pub(super) fn tick_step_cm(pixels_per_cm: f32) -> u32 {
    [1, 2, 5, 10, 20, 50].into_iter().find(|&step| step as f32 * pixels_per_cm >= 26.0).unwrap_or(100)
}

/// Warnings drawn over the picture, the most severe first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Banner {
    Waiting,
    Silent,
    Lost,
    Stale,
    Stuck,
}

impl Banner {
    /// Title and detail.
    fn texts(self) -> (&'static str, &'static str) {
        match self {
            Self::Waiting => ("WAITING", "the station has shown nothing yet"),
            Self::Silent => ("NO NEW FRAMES", "the picture is not live"),
            Self::Lost => ("TRACKING LOST", "the probe's pose is not known"),
            Self::Stale => ("STALE", "the picture no longer follows the probe"),
            Self::Stuck => ("STUCK", "the sensor repeats one reading"),
        }
    }

    /// Colours of background and text.
    fn colours(self) -> (Rgb, Rgb) {
        match self {
            Self::Waiting => (PANEL, INK),
            Self::Silent => (PANEL, [255, 90, 78]),
            Self::Lost => (BAD, [255; 3]),
            Self::Stale | Self::Stuck => (WARN, DARK),
        }
    }
}

/// Banner for a frame; `None` if nothing is wrong. `silent`: no new frame arrived for too long.
pub(super) fn banner(shown: Option<&Shown>, silent: bool) -> Option<Banner> {
    let Some(shown) = shown else { return Some(Banner::Waiting) };
    match shown.info.estimate.state {
        _ if silent && !shown.info.settings.frozen => Some(Banner::Silent),
        TrackingState::Lost => Some(Banner::Lost),
        TrackingState::Stale => Some(Banner::Stale),
        TrackingState::Stuck => Some(Banner::Stuck),
        TrackingState::Good | TrackingState::Held => None,
    }
}

/// Figures and states of the window that the marks show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Figures {
    pub(super) frames_per_s: usize,
    /// Latency of the newest frame, ms; none for a held pose.
    pub(super) latency_ms: Option<u64>,
    pub(super) help: bool,
    pub(super) banner: Option<Banner>,
}

/// Draws all marks into `canvas`, whose size is the window's.
pub(super) fn draw(canvas: &mut Canvas, shown: Option<&Shown>, figures: &Figures) {
    let (width, height) = canvas.size();
    canvas.fill(0, 0, width, height, [0; 3]);
    if let Some(shown) = shown {
        let at = placement((shown.width, shown.height), (width, height));
        depth_scale(canvas, shown, at);
        badges(canvas, shown, figures);
        settings(canvas, shown, at);
        if !shown.notice.is_empty() {
            let x = centred(width, Text::Small.width(&shown.notice));
            canvas.text(x, height.saturating_sub(70), &shown.notice, Text::Small, WARN);
        }
    }
    if let Some(banner) = figures.banner {
        draw_banner(canvas, banner);
    }
    if figures.help {
        help(canvas);
    }
}

fn centred(width: u32, text_width: u32) -> u32 {
    width.saturating_sub(text_width) / 2
}

fn depth_scale(canvas: &mut Canvas, shown: &Shown, at: Placement) {
    if shown.pixel_mm <= 0.0 || shown.height == 0 {
        return;
    }
    let scale = at.height / shown.height as f32;
    let pixels_per_mm = scale / shown.pixel_mm as f32;
    let y_at = |depth_mm: f32| at.y + shown.face_row as f32 * scale + depth_mm * pixels_per_mm;
    let x = (at.x + at.width + 12.0) as u32;
    let step = tick_step_cm(10.0 * pixels_per_mm);
    let depth_mm = shown.info.settings.probe.depth_mm as f32;
    for cm in 0..=(depth_mm / 10.0 + 1e-3) as u32 {
        let y = y_at(10.0 * cm as f32).round() as u32;
        if y > canvas.size().1 {
            break;
        }
        let numbered = cm % step == 0;
        canvas.fill(x, y, if numbered { 12 } else { 6 }, 1, FAINT);
        if numbered {
            canvas.text(x + 17, y.saturating_sub(Text::Small.height() / 2), &cm.to_string(), Text::Small, INK);
        }
    }
    canvas.text(x + 12, (y_at(0.0).min(canvas.size().1 as f32) as u32).saturating_sub(30), "cm", Text::Small, FAINT);
    // Focus marker: a triangle between picture and scale.
    let focus =
        y_at((shown.info.settings.probe.focus_mm as f32).min(depth_mm)).round().min(canvas.size().1 as f32) as u32;
    for column in 0..7 {
        canvas.fill(x - 9 + column, focus.saturating_sub(6 - column), 1, 2 * (6 - column) + 1, WARN);
    }
    // Marker on the side of the first scanline.
    let marker = (at.x + 0.5 * at.width - (0.24 * at.width).min(190.0)) as u32;
    let top = at.y as u32 + 8;
    canvas.fill(marker, top, 12, 12, ACCENT);
    canvas.fill(marker + 3, top + 3, 6, 6, DARK);
}

/// Word for the state of the pose, and its colour.
fn tracking_badge(shown: &Shown) -> (&'static str, Rgb) {
    match shown.info.estimate.state {
        TrackingState::Good => ("TRACKING", ACCENT),
        TrackingState::Held => ("POSE HELD", WARN),
        TrackingState::Stuck => ("STUCK", WARN),
        TrackingState::Stale => ("STALE", WARN),
        TrackingState::Lost => ("LOST", BAD),
    }
}

fn badges(canvas: &mut Canvas, shown: &Shown, figures: &Figures) {
    let run = if shown.info.settings.frozen { ("FROZEN", COLD) } else { ("LIVE", ACCENT) };
    let source = match shown.source {
        FrameSource::Generated => ("GENERATED", ACCENT),
        FrameSource::HeldGenerated => ("HELD GENERATED", WARN),
        FrameSource::Raw => ("RAW", FAINT),
    };
    let mut x = 14;
    for (text, colour) in [run, source, tracking_badge(shown), (shown.generator.as_str(), FAINT)] {
        canvas.text(x, 12, text, Text::Small, colour);
        x += Text::Small.width(text) + 22;
    }
    let latency = figures.latency_ms.map_or_else(|| "-".to_owned(), |ms| format!("{ms} ms"));
    let text = format!("{} frames/s   {latency}", figures.frames_per_s);
    let x = canvas.size().0.saturating_sub(Text::Small.width(&text) + 14);
    canvas.text(x, 12, &text, Text::Small, INK);
}

fn settings(canvas: &mut Canvas, shown: &Shown, at: Placement) {
    let text = format!("{}   ? keys", shown.info.settings.captions().join("   "));
    let x = centred(canvas.size().0, Text::Small.width(&text));
    canvas.text(x, (at.y + at.height) as u32 + 9, &text, Text::Small, FAINT);
}

fn draw_banner(canvas: &mut Canvas, banner: Banner) {
    let ((title, detail), (ground, ink)) = (banner.texts(), banner.colours());
    const FACTOR: u32 = 2;
    let title_width = FACTOR * Text::Large.width(title);
    let detail_width = Text::Small.width(detail);
    let width = title_width.max(detail_width) + 80;
    let (window_width, window_height) = canvas.size();
    let (x, y) = (centred(window_width, width), window_height / 4);
    canvas.fill(x, y, width, 100, ground);
    canvas.text_enlarged(centred(window_width, title_width), y + 14, title, Text::Large, FACTOR, ink);
    canvas.text(centred(window_width, detail_width), y + 68, detail, Text::Small, ink);
}

fn help(canvas: &mut Canvas) {
    let line = Text::Small.height() + 7;
    let keys: Vec<_> = hot_keys().iter().filter(|hot| hot.works_on(Display::Window)).collect();
    let (width, height) = (360, line * keys.len() as u32 + 32);
    let (window_width, window_height) = canvas.size();
    let (x, y) = (centred(window_width, width), window_height.saturating_sub(height) / 2);
    canvas.fill(x, y, width, height, PANEL);
    for (row, hot) in (0..).zip(keys) {
        let top = y + 16 + row * line;
        canvas.text(x + 24, top, hot.shown, Text::Small, ACCENT);
        canvas.text(x + 130, top, hot.meaning, Text::Small, INK);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::LiveSettings;

    fn shown() -> Shown {
        Shown { width: 1386, height: 1000, pixel_mm: 0.157, face_row: 45.0, ..Shown::default() }
    }

    fn in_state(state: TrackingState) -> Shown {
        let mut shown = shown();
        shown.info.estimate.state = state;
        shown
    }

    fn good() -> Shown {
        in_state(TrackingState::Good)
    }

    #[test]
    fn the_picture_keeps_its_shape_and_lies_inside() {
        for window in [(1920, 1080), (800, 1200), (3840, 1000), (1, 1)] {
            let at = placement((1386, 1000), window);
            assert!((at.width / at.height - 1.386).abs() < 1e-3, "{window:?}");
            if window.0 > 200 {
                assert!(at.x >= MARGIN_X - 0.01 && at.x + at.width <= window.0 as f32 - MARGIN_X + 0.01);
                assert!(at.y >= MARGIN_TOP - 0.01 && at.y + at.height <= window.1 as f32 - MARGIN_BOTTOM + 0.01);
            }
        }
    }

    #[test]
    fn numbers_of_the_scale_keep_their_distance() {
        for pixels_per_cm in [0.3, 2.0, 9.0, 30.0, 400.0] {
            let step = tick_step_cm(pixels_per_cm);
            assert!(step == 100 || step as f32 * pixels_per_cm >= 26.0);
        }
        assert_eq!((tick_step_cm(60.0), tick_step_cm(10.0)), (1, 5));
    }

    #[test]
    fn the_worst_state_is_told() {
        let lost = in_state(TrackingState::Lost);
        let mut frozen = good();
        frozen.info.settings.frozen = true;
        assert_eq!(banner(None, true), Some(Banner::Waiting));
        assert_eq!(banner(Some(&lost), true), Some(Banner::Silent));
        assert_eq!(banner(Some(&lost), false), Some(Banner::Lost));
        assert_eq!(banner(Some(&good()), true), Some(Banner::Silent));
        let stuck = in_state(TrackingState::Stuck);
        assert_eq!(banner(Some(&stuck), false).map(|banner| banner.texts().0), Some("STUCK"));
        assert_eq!(tracking_badge(&stuck).0, "STUCK");
        assert_eq!(banner(Some(&frozen), true), None);
        assert_eq!(banner(Some(&good()), false), None);
    }

    #[test]
    fn a_banner_is_drawn_over_the_middle_and_goes_again() {
        let mut canvas = Canvas::new(1280, 800, [0; 3]);
        let figures = Figures { frames_per_s: 24, latency_ms: Some(40), help: false, banner: Some(Banner::Stale) };
        draw(&mut canvas, Some(&good()), &figures);
        let at = |canvas: &Canvas, x: usize, y: usize| {
            <[u8; 3]>::try_from(&canvas.as_rgb()[3 * (y * 1280 + x)..][..3]).unwrap()
        };
        assert_eq!(at(&canvas, 640, 202), WARN);
        draw(&mut canvas, Some(&good()), &Figures { banner: None, help: true, ..figures });
        // Pixels between the texts of the key list have the panel's colour.
        let panel = (150..650).filter(|&y| at(&canvas, 640, y) == PANEL).count();
        assert!(at(&canvas, 640, 202) != WARN && panel > 250, "{panel}");
        draw(&mut canvas, Some(&good()), &Figures { banner: None, ..figures });
        assert_eq!(at(&canvas, 640, 202), [0; 3]);
    }

    #[test]
    fn odd_sizes_and_settings_do_no_harm() {
        let figures = Figures { frames_per_s: 0, latency_ms: None, help: true, banner: Some(Banner::Lost) };
        for size in [(1, 1), (60, 40), (300, 90)] {
            let mut canvas = Canvas::new(size.0, size.1, [0; 3]);
            let mut deep = LiveSettings::default();
            (deep.probe.depth_mm, deep.probe.focus_mm) = (500.0, 1000.0);
            let mut far = good();
            far.info.settings = deep;
            for odd in [Shown::default(), far, Shown { pixel_mm: 1e-9, ..good() }] {
                draw(&mut canvas, Some(&odd), &figures);
            }
            draw(&mut canvas, None, &figures);
        }
    }
}
