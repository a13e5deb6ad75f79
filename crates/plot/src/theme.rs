//! Colours as CSS, with the light theme as attributes for whoever reads no CSS.

/// Everything that has a colour: the eight of [`crate::Colour`], then these.
pub(crate) const TEXT: u8 = 8;
pub(crate) const MUTED: u8 = 9;
pub(crate) const GRID: u8 = 10;
pub(crate) const BACKGROUND: u8 = 11;

/// Light, by number.
const LIGHT: [&str; 12] = [
    "#0072b2", "#c8500a", "#00805a", "#a8528a", "#b07800", "#2a8fc4", "#1c2430", "#7c8592",
    "#1c2430", "#586272", "#dfe3e8", "#ffffff",
];

/// The fallback of a colour.
pub(crate) fn light(ink: u8) -> &'static str {
    LIGHT[usize::from(ink) % LIGHT.len()]
}

/// Style of all plots of a page; put it once into a `<style>` element.
pub const STYLE: &str = "\
.dtp{--dt0:#0072b2;--dt1:#c8500a;--dt2:#00805a;--dt3:#a8528a;--dt4:#b07800;--dt5:#2a8fc4;\
--dt6:#1c2430;--dt7:#7c8592;--dt8:#1c2430;--dt9:#586272;--dt10:#dfe3e8;--dt11:#ffffff}
@media screen and (prefers-color-scheme:dark){.dtp{--dt0:#4ba3e3;--dt1:#ff8a4c;--dt2:#3cc79a;\
--dt3:#e392c6;--dt4:#f0bd45;--dt5:#8fd0f5;--dt6:#e8ebf0;--dt7:#939dab;--dt8:#e8ebf0;\
--dt9:#a4adba;--dt10:#333a45;--dt11:#14181e}}
.dtp{display:block;width:100%;height:auto}
.dtp text{font-family:system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',Arial,\
'DejaVu Sans',sans-serif;font-variant-numeric:tabular-nums}
.dts0{stroke:var(--dt0)}.dts1{stroke:var(--dt1)}.dts2{stroke:var(--dt2)}.dts3{stroke:var(--dt3)}
.dts4{stroke:var(--dt4)}.dts5{stroke:var(--dt5)}.dts6{stroke:var(--dt6)}.dts7{stroke:var(--dt7)}
.dts8{stroke:var(--dt8)}.dts9{stroke:var(--dt9)}.dts10{stroke:var(--dt10)}.dts11{stroke:var(--dt11)}
.dtf0{fill:var(--dt0)}.dtf1{fill:var(--dt1)}.dtf2{fill:var(--dt2)}.dtf3{fill:var(--dt3)}
.dtf4{fill:var(--dt4)}.dtf5{fill:var(--dt5)}.dtf6{fill:var(--dt6)}.dtf7{fill:var(--dt7)}
.dtf8{fill:var(--dt8)}.dtf9{fill:var(--dt9)}.dtf10{fill:var(--dt10)}.dtf11{fill:var(--dt11)}
";

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance of WCAG 2.
    fn luminance(hex: &str) -> f64 {
        let part = |i: usize| {
            let c = f64::from(u8::from_str_radix(&hex[i..i + 2], 16).unwrap()) / 255.0;
            if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * part(1) + 0.7152 * part(3) + 0.0722 * part(5)
    }

    fn contrast(a: &str, b: &str) -> f64 {
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    fn theme(part: &str) -> Vec<String> {
        (0..LIGHT.len())
            .map(|i| {
                let key = format!("--dt{i}:");
                let at = part.find(&key).unwrap() + key.len();
                part[at..at + 7].to_owned()
            })
            .collect()
    }

    #[test]
    fn oracle_lines_and_text_stand_out_in_both_themes() {
        let (light, dark) = STYLE.split_once("@media").unwrap();
        assert_eq!(theme(light), LIGHT, "style and fallback agree");
        for colours in [theme(light), theme(dark)] {
            let paper = &colours[usize::from(BACKGROUND)];
            for (i, c) in colours[..8].iter().enumerate() {
                // WCAG 2.1, 1.4.11: graphics 3:1.
                assert!(contrast(c, paper) >= 3.0, "colour {i}: {}", contrast(c, paper));
            }
            for i in [TEXT, MUTED] {
                // 1.4.3: text 4.5:1.
                assert!(contrast(&colours[usize::from(i)], paper) >= 4.5);
            }
        }
    }
}
