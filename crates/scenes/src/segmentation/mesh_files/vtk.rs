//! Legacy VTK files of polydata, text and binary.

use glam::DVec3;

use super::super::numbers::{Number, Order};
use super::Parsed;
use super::cells::Cells;
use super::draft::Draft;
use super::error::Fault;
use super::scanner::{Scanner, text};

/// Number of the line that names the data set.
const DATASET_LINE: usize = 4;

struct Reader<'b> {
    scanner: Scanner<'b>,
    binary: bool,
    parsed: Parsed,
    draft: Draft,
}

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Fault> {
    let mut scanner = Scanner::new(bytes);
    scanner.line();
    let mut parsed = Parsed::default();
    parsed.hints.take(&String::from_utf8_lossy(scanner.line().unwrap_or_default()));
    let binary = match scanner.word().map(<[u8]>::to_ascii_uppercase).as_deref() {
        Some(b"ASCII") => false,
        Some(b"BINARY") => true,
        other => {
            let found = text(other.unwrap_or_default());
            return Err(Fault::line(3, format!("`{found}`: it must be ASCII or BINARY")));
        }
    };
    let (dataset, kind) = (scanner.word(), scanner.word());
    if dataset.is_none_or(|word| !word.eq_ignore_ascii_case(b"DATASET")) {
        return Err(Fault::line(DATASET_LINE, "it must be DATASET POLYDATA"));
    }
    let kind = kind.unwrap_or_default();
    if !kind.eq_ignore_ascii_case(b"POLYDATA") {
        return Err(Fault::line(DATASET_LINE, not_polydata(&text(kind))));
    }
    let mut reader = Reader { scanner, binary, parsed, draft: Draft::default() };
    while let Some(word) = reader.scanner.word() {
        if reader.section(&word.to_ascii_uppercase())? {
            break;
        }
    }
    reader.parsed.drafts.push(reader.draft);
    Ok(reader.parsed)
}

/// Message about a data set that is not a surface.
pub(super) fn not_polydata(kind: &str) -> String {
    let lower = kind.to_lowercase();
    let remedy = if lower.contains("unstructured") {
        "extract the surface (ParaView: Filters > Extract Surface) and save it as PolyData"
    } else if ["structured_points", "imagedata"].contains(&lower.as_str()) {
        "it is a picture: `insonify scene from-labels` reads label maps as NIfTI or NRRD"
    } else {
        "save the surface as PolyData"
    };
    format!("the data set is {kind}, not polydata: {remedy}")
}

impl Reader<'_> {
    /// Reads the section that starts with `keyword`. Returns true for point and cell data, which follow the geometry.
    fn section(&mut self, keyword: &[u8]) -> Result<bool, Fault> {
        match keyword {
            b"POINTS" => self.points()?,
            b"POLYGONS" => self.cells(Some(Cells::Polygons))?,
            b"TRIANGLE_STRIPS" => self.cells(Some(Cells::Strips))?,
            b"VERTICES" | b"LINES" => self.parsed.others += self.other_cells()?,
            b"METADATA" => self.metadata(),
            b"FIELD" => self.field()?,
            b"POINT_DATA" | b"CELL_DATA" => return Ok(true),
            other => return Err(self.scanner.fault(format!("`{}` is no section of polydata", text(other)))),
        }
        Ok(false)
    }

    /// Skips metadata on arrays, up to an empty line.
    fn metadata(&mut self) {
        self.scanner.line();
        while self.scanner.line().is_some_and(|line| !line.trim_ascii().is_empty()) {}
    }

    /// `count` numbers in the file's encoding. `what` names them in errors.
    fn numbers(&mut self, count: usize, number: Number, what: &str) -> Result<Vec<f64>, Fault> {
        if self.binary {
            self.scanner.line();
            return self.scanner.numbers(count, number, Order::Big, what);
        }
        (0..count).map(|_| self.scanner.number(what)).collect()
    }

    fn number_type(&mut self) -> Result<Number, Fault> {
        let word = self.scanner.word().unwrap_or_default();
        number(&text(word)).ok_or_else(|| self.scanner.fault(format!("`{}` is no type of numbers", text(word))))
    }

    fn points(&mut self) -> Result<(), Fault> {
        let count = self.scanner.count("the number of points")?;
        let number = self.number_type()?;
        let values = self.numbers(count.saturating_mul(3), number, "the coordinates of the points")?;
        self.parsed.vertices = values.as_chunks::<3>().0.iter().map(|at| DVec3::from_array(*at)).collect();
        Ok(())
    }

    fn other_cells(&mut self) -> Result<usize, Fault> {
        let count = self.scanner.clone().count("the number of cells")?;
        self.cells(None)?;
        Ok(count)
    }

    /// Reads a list of cells of `kind`; `None` for kinds without triangles, whose cells are dropped.
    fn cells(&mut self, kind: Option<Cells>) -> Result<(), Fault> {
        let first = self.scanner.count("the number of cells")?;
        let size = self.scanner.count("the size of the list of cells")?;
        let at = self.scanner.clone();
        let what = "the corners of the cells";
        let is_new = self.scanner.peek().is_some_and(|word| word.eq_ignore_ascii_case(b"OFFSETS"));
        let (vertices, draft) = (std::mem::take(&mut self.parsed.vertices), &mut Draft::default());
        std::mem::swap(draft, &mut self.draft);
        let result = if is_new {
            self.scanner.word();
            let number = self.number_type()?;
            let ends = self.numbers(first, number, "the offsets of the cells")?;
            self.scanner.word();
            let number = self.number_type()?;
            let corners = self.numbers(size, number, what)?;
            kind.map_or(Ok(()), |kind| kind.add_by_ends(ends.get(1..).unwrap_or_default(), &corners, &vertices, draft))
        } else {
            let values = self.numbers(size, Number::I32, what)?;
            kind.map_or(Ok(()), |kind| kind.add_counted(first, &values, &vertices, draft))
        };
        self.parsed.vertices = vertices;
        std::mem::swap(draft, &mut self.draft);
        result.map_err(|reason| at.fault(reason))
    }

    /// Reads arrays that belong to the whole data set. Text arrays may name the axes.
    fn field(&mut self) -> Result<(), Fault> {
        self.scanner.word();
        let arrays = self.scanner.count("the number of arrays")?;
        for _ in 0..arrays {
            let mut name = self.scanner.word().map(text).unwrap_or_default();
            if name == "METADATA" {
                self.metadata();
                name = self.scanner.word().map(text).unwrap_or_default();
            }
            let components = self.scanner.count("the number of components of a field")?;
            let tuples = self.scanner.count("the number of tuples of a field")?;
            let count = components.saturating_mul(tuples);
            if self.scanner.peek() == Some(b"string") {
                self.scanner.word();
                self.scanner.line();
                for _ in 0..count {
                    let value = self.string()?;
                    self.parsed.hints.take(&format!("{name}={value}"));
                }
            } else {
                let number = self.number_type()?;
                self.numbers(count, number, "the values of a field")?;
            }
        }
        Ok(())
    }

    /// A text of a field: a line in a text file; a length followed by bytes in a binary file.
    fn string(&mut self) -> Result<String, Fault> {
        if !self.binary {
            let line = self.scanner.line().map(|line| String::from_utf8_lossy(line).into_owned());
            return line.ok_or_else(|| self.scanner.fault("truncated: a text of a field should be here"));
        }
        // The two highest bits encode the size of the length in bytes.
        let first = *self.scanner.bytes.get(self.scanner.at).unwrap_or(&0);
        let size = [8, 4, 2, 1][usize::from(first >> 6)];
        let length = self.scanner.take(size, "the length of a text")?.iter();
        let length = length.fold(0u64, |sum, byte| (sum << 8) | u64::from(*byte)) & (u64::MAX >> (64 - 8 * size + 2));
        let length = usize::try_from(length).unwrap_or(usize::MAX);
        self.scanner.take(length, "a text of a field").map(|bytes| String::from_utf8_lossy(bytes).into_owned())
    }
}

fn number(name: &str) -> Option<Number> {
    Some(match name.to_lowercase().as_str() {
        "char" | "signed_char" | "vtktypeint8" => Number::I8,
        "unsigned_char" | "vtktypeuint8" => Number::U8,
        "short" | "vtktypeint16" => Number::I16,
        "unsigned_short" | "vtktypeuint16" => Number::U16,
        "int" | "vtktypeint32" | "vtkidtype" => Number::I32,
        "unsigned_int" | "vtktypeuint32" => Number::U32,
        "long" | "vtktypeint64" => Number::I64,
        "unsigned_long" | "vtktypeuint64" => Number::U64,
        "float" => Number::F32,
        "double" => Number::F64,
        _ => return None,
    })
}
