//! What slicers say about a whole file: filament, layers, widths, firmware, and their own name. They write it at the
//! head of the file or at its end.

use super::firmware::Firmware;
use super::words::{number, quote};
use memchr::memmem;

/// Bytes kept of the settings that Cura spreads over many lines.
const CURA_BYTES_MAX: usize = 1 << 18;

/// Most extruders that a list of settings may have.
const EXTRUDERS_MAX: usize = 1 << 10;

/// What the slicer's settings say, wherever in the file they stand. Lengths in mm.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SlicerSettings {
    /// Filament diameter of each tool.
    pub(super) filament_diameters: Vec<f64>,
    /// E counts mm³ instead of mm of filament.
    pub(super) volumetric: bool,
    /// The usual layer height.
    pub(super) layer_height: Option<f64>,
    pub(super) first_layer_height: Option<f64>,
    /// The usual width of beads.
    pub(super) line_width: Option<f64>,
    pub(super) nozzle_diameter: Option<f64>,
    /// All filaments go through one nozzle.
    pub(super) shares_nozzle: bool,
    /// The slicer and its version.
    pub(super) slicer: Option<String>,
    /// Diameters by tool that M200 tells.
    pub(super) told_by_m200: Vec<f64>,
    flavor: Option<NamedFirmware>,
    /// What `M115` answered, or a comment that begins as its answer does.
    answer: Option<NamedFirmware>,
    /// The printer, where its maker's firmware is known.
    printer: Option<NamedFirmware>,
    /// Settings of Cura, without their prefix.
    cura: Vec<u8>,
    /// Extruder that KISSlicer's next settings concern, from 1.
    kisslicer_extruder: usize,
}

/// A firmware, and the words of the file that name it.
#[derive(Clone, Debug, PartialEq)]
struct NamedFirmware {
    firmware: Firmware,
    by: String,
}

impl SlicerSettings {
    /// Takes in a comment, from its semicolon. A setting reads `; key = value`, `; key: value` or `; key,value`.
    #[inline]
    pub(super) fn read(&mut self, comment: &[u8]) {
        let text = comment[1..].trim_ascii_start();
        // Nearly every comment ends here: few begin with these letters.
        let may_be_setting = matches!(
            text.first(),
            Some(
                b'f' | b'i'
                    | b'u'
                    | b'l'
                    | b'L'
                    | b'F'
                    | b'e'
                    | b'p'
                    | b'n'
                    | b'g'
                    | b's'
                    | b'S'
                    | b'G'
                    | b'K'
                    | b'B'
                    | b'O'
                    | b'N'
                    | b'*'
            )
        );
        // These are not settings, but stand before many beads.
        let is_common = text.starts_with(b"FEATURE:") || text.starts_with(b"L") && text.get(1) != Some(&b'a');
        if may_be_setting && !is_common {
            self.read_setting(text);
        }
    }

    fn read_setting(&mut self, text: &[u8]) {
        if let Some(cura) = text.strip_prefix(b"SETTING_3 ") {
            let room = CURA_BYTES_MAX - self.cura.len().min(CURA_BYTES_MAX);
            return self.cura.extend_from_slice(&cura[..cura.len().min(room)]);
        }
        self.read_slicer(text);
        if let Some(extruder) = text.strip_prefix(b"*** Material Settings for Extruder ") {
            self.kisslicer_extruder = number(extruder).map_or(0, |found| found.value as usize);
            return;
        }
        let Some(split) = text.iter().take(80).position(|b| matches!(b, b'=' | b':' | b',')) else { return };
        let (key, value) = (text[..split].trim_ascii(), text[split + 1..].trim_ascii());
        match key {
            b"filament_diameter" | b"filamentDiameters" | b"filamentDiameter" => {
                let parts = value.split(|b| matches!(b, b',' | b';' | b'|')).take(EXTRUDERS_MAX);
                let sizes: Option<Vec<f64>> = parts.map(|part| size(part.trim_ascii())).collect();
                self.filament_diameters = sizes.unwrap_or_default();
            }
            b"fiber_dia_mm" => self.filament_of(self.kisslicer_extruder.max(1), size(value)),
            b"use_volumetric_e" => self.volumetric = value == b"1",
            b"Filament used" => self.volumetric |= is_volume(value),
            b"layer_height" | b"Layer height" | b"Layer Height" | b"layerHeight" | b"layer_thickness_mm" => {
                self.layer_height = size(value).or(self.layer_height);
            }
            b"first_layer_height" | b"initial_layer_print_height" | b"first_layer_thickness_mm" => {
                self.first_layer_height = size(value).or(self.first_layer_height);
            }
            b"extrusion_width" | b"line_width" | b"extruderWidth" | b"extrusion_width_mm" => {
                self.line_width = size(value).or(self.line_width);
            }
            b"perimeters extrusion width" if self.line_width.is_none() => self.line_width = size(value),
            b"nozzle_diameter" | b"extruderDiameter" | b"Nozzle Diameter #1" => {
                let first = value.split(|b| matches!(b, b',' | b'|')).next().unwrap_or(value);
                self.nozzle_diameter = size(first).or(self.nozzle_diameter);
            }
            b"single_extruder_multi_material" => self.shares_nozzle = value == b"1",
            b"FLAVOR" => self.cura_flavor(text, value),
            b"gcode_flavor" => self.flavor = named(flavor_of_slic3r(value), text).or(self.flavor.take()),
            b"FIRMWARE_NAME" | b"Firmware" | b"firmware" | b"firmware_name" => {
                let answer = Firmware::by_answer(&String::from_utf8_lossy(value));
                self.answer = self.answer.take().or(named(answer, text));
            }
            b"printer_model" => self.printer_model(text, value),
            _ => {
                if let Some(tool) = key.strip_prefix(b"Filament Diameter #").and_then(number) {
                    self.filament_of(tool.value as usize, size(value));
                }
            }
        }
    }

    /// The diameter of the filament of the `tool`-th extruder, from 1.
    fn filament_of(&mut self, tool: usize, diameter: Option<f64>) {
        if let (Some(diameter), 1..=EXTRUDERS_MAX) = (diameter, tool) {
            if self.filament_diameters.len() < tool {
                self.filament_diameters.resize(tool, diameter);
            }
            self.filament_diameters[tool - 1] = diameter;
        }
    }

    fn read_slicer(&mut self, text: &[u8]) {
        if self.slicer.is_some() {
            return;
        }
        let after = |key: &[u8]| text.strip_prefix(key);
        let name = after(b"generated by ")
            .or(after(b"Generated with "))
            .or(after(b"G-Code generated by "))
            .or(after(b"GENERATOR.NAME:"))
            .or(after(b"Sliced by "));
        let is_slicer = |name: &&[u8]| text.starts_with(name);
        let itself = [&b"KISSlicer"[..], b"BambuStudio", b"OrcaSlicer"].iter().any(is_slicer);
        if let Some(name) = name.or(itself.then_some(text)) {
            let name = String::from_utf8_lossy(&name[..name.len().min(60)]).trim().to_owned();
            // A date follows.
            let end = name.find(" on ").or(name.find(", ")).unwrap_or(name.len());
            let name = name[..end].trim_end().to_owned();
            if name.starts_with("BambuStudio") {
                self.printer = named(Some(Firmware::Bambu), text);
            }
            self.slicer = Some(name);
        }
    }

    fn cura_flavor(&mut self, text: &[u8], value: &[u8]) {
        let firmware = Firmware::by_name(&String::from_utf8_lossy(value));
        self.volumetric |=
            firmware == Some(Firmware::UltiGCode) || memmem::find(value, b"olumetric").is_some();
        self.flavor = named(firmware, text).or(self.flavor.take());
    }

    fn printer_model(&mut self, text: &[u8], value: &[u8]) {
        if [&b"MK2"[..], b"MK3"].iter().any(|model| value.starts_with(model)) && !value.starts_with(b"MK3.") {
            self.printer = named(Some(Firmware::Prusa), text);
        } else if value.starts_with(b"Bambu Lab") {
            self.printer = named(Some(Firmware::Bambu), text);
        }
    }

    /// Takes in a line that begins with M: what it says of printer, firmware or filament.
    pub(super) fn read_command(&mut self, line: &[u8]) {
        let quoted = |line: &[u8]| line.split(|b| *b == b'"').nth(1).map(<[u8]>::to_vec);
        if line.starts_with(b"M862.3") {
            self.printer_model(line, &quoted(line).unwrap_or_default());
        } else if let Some(version) = line.strip_prefix(b"M115 U") {
            // Prusa's slicer asks for this version of its maker's firmware; 4 and later are on 32-bit boards.
            let major = number(version).map_or(0.0, |found| found.value.trunc());
            let firmware = if major < 4.0 { Firmware::Prusa } else { Firmware::Marlin2 };
            self.printer = self.printer.take().or(named(Some(firmware), line));
        } else if line.starts_with(b"M200") {
            let (tool, diameters) = m200_diameters(&line[4..]);
            for (i, diameter) in diameters.into_iter().enumerate().filter(|(_, d)| *d > 0.0) {
                let tool = tool.unwrap_or(0) + i;
                if tool < EXTRUDERS_MAX {
                    let told = &mut self.told_by_m200;
                    told.resize(told.len().max(tool + 1), diameter);
                    told[tool] = diameter;
                }
            }
        }
    }

    /// Takes in what was spread over many lines.
    pub(super) fn finish(&mut self) {
        let cura = std::mem::take(&mut self.cura);
        let find = |key: &[u8]| {
            let at = memmem::find(&cura, key)? + key.len();
            let found = number(&cura[at..])?;
            (found.value > 0.0 && found.value <= super::SIZE_MAX).then_some(found.value)
        };
        if self.filament_diameters.is_empty() {
            self.filament_diameters.extend(find(b"material_diameter = "));
        }
        self.line_width = self.line_width.or(find(b"\\nline_width = "));
        self.layer_height = self.layer_height.or(find(b"\\nlayer_height = "));
    }

    /// The firmware that the file names, and the words that do.
    pub(super) fn firmware(&self) -> Option<(Firmware, &str)> {
        // A maker's own Marlin goes by the name of Marlin in the slicer's settings.
        let is_marlin =
            |named: &NamedFirmware| matches!(named.firmware, Firmware::Marlin | Firmware::Marlin2);
        let printer = self.printer.as_ref().filter(|_| self.flavor.as_ref().is_none_or(is_marlin));
        let named = self.answer.as_ref().or(printer).or(self.flavor.as_ref())?;
        Some((named.firmware, &named.by))
    }

    /// Whether E counts mm³ from the start.
    pub(super) fn is_volumetric(&self, firmware: Firmware) -> bool {
        self.volumetric || firmware.is_volumetric()
    }
}

fn named(firmware: Option<Firmware>, text: &[u8]) -> Option<NamedFirmware> {
    let quoted = quote(text.trim_ascii_end());
    firmware.map(|firmware| NamedFirmware { firmware, by: quoted[1..quoted.len() - 1].to_owned() })
}

/// Slic3r and its descendants: "reprap" is the family of Marlin and Sprinter, not RepRapFirmware.
fn flavor_of_slic3r(value: &[u8]) -> Option<Firmware> {
    match value {
        b"reprap" => Some(Firmware::Sprinter),
        b"no-extrusion" => None,
        value => Firmware::by_name(&String::from_utf8_lossy(value)),
    }
}

/// The tool and the diameters of M200's words: `T0 D1.75`, or `D1.75:2.85` for each extruder.
pub(super) fn m200_diameters(words: &[u8]) -> (Option<usize>, Vec<f64>) {
    let code = &words[..words.iter().position(|b| matches!(b, b';' | b'(')).unwrap_or(words.len())];
    let after = |letter: u8| {
        let at = code.iter().position(|b| b.eq_ignore_ascii_case(&letter))?;
        Some(code[at + 1..].trim_ascii_start())
    };
    let tool = after(b'T').and_then(number).map(|found| found.value as usize);
    let list = after(b'D').unwrap_or_default();
    let end = list.iter().position(|b| b.is_ascii_alphabetic() || *b == b' ').unwrap_or(list.len());
    let diameters = list[..end].split(|b| *b == b':').take(EXTRUDERS_MAX).filter_map(number);
    (tool, diameters.map(|found| found.value).filter(|d| *d <= super::SIZE_MAX).collect())
}

/// Whether Cura says that the filament used is a volume: `20.0mm3`, or several of them.
fn is_volume(value: &[u8]) -> bool {
    value.first().is_some_and(u8::is_ascii_digit) && memmem::find(value, b"mm3").is_some()
}

/// A length in mm that a bead can have, with its unit or without.
pub(super) fn size(text: &[u8]) -> Option<f64> {
    let text = text.strip_suffix(b"mm").map_or(text, <[u8]>::trim_ascii_end);
    let found = number(text)?;
    (found.length == text.len() && found.value > 0.0 && found.value <= super::SIZE_MAX).then_some(found.value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(lines: &[&str]) -> SlicerSettings {
        let mut settings = SlicerSettings::default();
        for line in lines {
            match line.as_bytes().first() {
                Some(b';') => settings.read(line.as_bytes()),
                _ => settings.read_command(line.as_bytes()),
            }
        }
        settings.finish();
        settings
    }

    #[test]
    fn every_slicer_tells_its_filament_and_layers() {
        for (lines, diameters, height, width) in [
            (
                &["; filament_diameter = 1.75,2.85", "; layer_height = 0.2", "; extrusion_width = 0.45"][..],
                &[1.75, 2.85][..],
                Some(0.2),
                Some(0.45),
            ),
            (&["; perimeters extrusion width = 0.60mm", "; extrusion_width = 0"], &[], None, Some(0.6)),
            (&["; filament_diameter: 1.75,1.75", "; line_width = 0.42"], &[1.75, 1.75], None, Some(0.42)),
            (
                &[";   filamentDiameters,2.85|1.75", ";   layerHeight,0.3", ";   extruderWidth,0.48"],
                &[2.85, 1.75],
                Some(0.3),
                Some(0.48),
            ),
            (
                &[
                    "; *** Material Settings for Extruder 1 ***",
                    "; fiber_dia_mm = 3",
                    "; *** Material Settings for Extruder 2 ***",
                    "; fiber_dia_mm = 1.75",
                    "; layer_thickness_mm = 0.25",
                    "; layer_thickness_mm = -33",
                    "; extrusion_width_mm = 0.5",
                ],
                &[3.0, 1.75],
                Some(0.25),
                Some(0.5),
            ),
            (
                &[";Filament Diameter #1: 1.750", ";Filament Diameter #2: 2.850", ";Layer Height: 0.2"],
                &[1.75, 2.85],
                Some(0.2),
                None,
            ),
            (
                &[
                    ";SETTING_3 {\"global_quality\": \"[values]\\\\nlayer_height = 0.15\\\\n\", \"extruder\": [\"mater",
                    ";SETTING_3 ial_diameter = 2.85\\\\nline_width = 0.35\\\\n\"]}",
                ],
                &[2.85],
                Some(0.15),
                Some(0.35),
            ),
            (&["; filament_diameter = 1.75,x"], &[], None, None),
        ] {
            let settings = read(lines);
            assert_eq!(settings.filament_diameters, diameters, "{lines:?}");
            assert_eq!((settings.layer_height, settings.line_width), (height, width), "{lines:?}");
        }
    }

    #[test]
    fn firmware_is_named_in_many_ways() {
        for (lines, firmware) in [
            (&[";FLAVOR:RepRap"][..], Some(Firmware::RepRapFirmware)),
            (&["; gcode_flavor = reprap"], Some(Firmware::Sprinter)),
            (&["; gcode_flavor = reprapfirmware"], Some(Firmware::RepRapFirmware)),
            (&["; gcode_flavor = marlin", "M862.3 P \"MK3S\""], Some(Firmware::Prusa)),
            (&["M115 U3.13.2", "; gcode_flavor = klipper"], Some(Firmware::Klipper)),
            (&["M115 U5.1.0 ; MK4"], Some(Firmware::Marlin2)),
            (&[";FLAVOR:Marlin", ";FIRMWARE_NAME:RepRapFirmware for Duet"], Some(Firmware::RepRapFirmware)),
            (&["; BambuStudio 01.08.00.62", "; gcode_flavor = marlin"], Some(Firmware::Bambu)),
            (&["; gcode_flavor = no-extrusion"], None),
            (&["; printer_model = MK3.5"], None),
            (&[";FLAVOR:Nonsense"], None),
        ] {
            assert_eq!(read(lines).firmware().map(|named| named.0), firmware, "{lines:?}");
        }
        assert_eq!(read(&[";FLAVOR:RepRap"]).firmware().unwrap().1, "FLAVOR:RepRap");
    }

    #[test]
    fn volumes_are_told_by_flavor_or_by_what_is_used() {
        for (line, volumetric) in [
            (";FLAVOR:Marlin(Volumetric)", true),
            (";FLAVOR:UltiGCode", true),
            (";FLAVOR:Griffin", false),
            ("; use_volumetric_e = 1", true),
            (";Filament used: 20.0mm3", true),
            (";Filament used: 1.2m, 0m", false),
        ] {
            assert_eq!(read(&[line]).is_volumetric(Firmware::Unnamed), volumetric, "{line}");
        }
        assert!(SlicerSettings::default().is_volumetric(Firmware::UltiGCode));
    }

    #[test]
    fn slicers_name_themselves() {
        for (line, slicer) in [
            (
                "; generated by PrusaSlicer 2.5.0+debian on 2026-11-01 at 10:00:00 UTC",
                "PrusaSlicer 2.5.0+debian",
            ),
            (";Generated with Cura_SteamEngine 5.2.1", "Cura_SteamEngine 5.2.1"),
            ("; G-Code generated by Simplify3D(R) Version 4.1.2", "Simplify3D(R) Version 4.1.2"),
            ("; KISSlicer - FREE", "KISSlicer - FREE"),
            (";Sliced by ideaMaker 4.1.1.4956, 2021-06-01", "ideaMaker 4.1.1.4956"),
            ("; BambuStudio 01.08.00.62", "BambuStudio 01.08.00.62"),
            (";GENERATOR.NAME:Cura_SteamEngine", "Cura_SteamEngine"),
        ] {
            assert_eq!(read(&[line]).slicer.as_deref(), Some(slicer), "{line}");
        }
    }

    #[test]
    fn m200_tells_diameters_by_tool() {
        assert_eq!(m200_diameters(b" T1 D2.85 ; D1"), (Some(1), vec![2.85]));
        assert_eq!(m200_diameters(b" D1.75:2.85 S1"), (None, vec![1.75, 2.85]));
        assert_eq!(m200_diameters(b" S1"), (None, vec![]));
        assert_eq!(read(&["M200 T1 D2.85", "M200 T0 D1.75"]).told_by_m200, [1.75, 2.85]);
    }
}
