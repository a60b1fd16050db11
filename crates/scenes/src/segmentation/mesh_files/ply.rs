//! PLY files, text and binary.

use glam::DVec3;
use insonify_core::names::counted;

use super::super::numbers::{Number, Order};
use super::Parsed;
use super::draft::Draft;
use super::error::Fault;
use super::scanner::{Scanner, finite, index, not_a_number, text};

/// An element type of the header, such as `vertex`.
struct Element {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

/// A property of an element: its name and the type of its values. For a list, `length` is the type of the list's
/// length.
struct Property {
    name: String,
    length: Option<Number>,
    value: Number,
}

/// Encoding of the data.
#[derive(Clone, Copy)]
enum Data {
    Text,
    Binary(Order),
}

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Fault> {
    let mut scanner = Scanner::new(bytes);
    let mut parsed = Parsed::default();
    let (data, elements) = header(&mut scanner, &mut parsed)?;
    let mut draft = Draft::default();
    for element in &elements {
        match element.name.as_str() {
            "vertex" => vertices(&mut scanner, data, element, &mut parsed)?,
            "face" | "tristrips" => faces(&mut scanner, data, element, &parsed.vertices, &mut draft)?,
            _ => {
                parsed.others += if element.name == "edge" { element.count } else { 0 };
                let count = if element.properties.is_empty() { 0 } else { element.count };
                for number in 0..count {
                    record(&mut scanner, data, element, number, |_, _| Ok(()))?;
                }
            }
        }
    }
    check_rest(&scanner, data)?;
    parsed.drafts.push(draft);
    Ok(parsed)
}

/// Refuses data after the last element, except padding, since the file has more elements than the header announces.
fn check_rest(scanner: &Scanner<'_>, data: Data) -> Result<(), Fault> {
    let rest = scanner.bytes.get(scanner.at..).unwrap_or_default();
    if rest.iter().all(|b| *b == 0 || b.is_ascii_whitespace()) {
        return Ok(());
    }
    let left = counted(rest.len(), "byte");
    let reason = format!("{left} follow the last element: a count of the header is too low; export the mesh again");
    Err(match data {
        Data::Text => scanner.fault(reason),
        Data::Binary(_) => Fault::byte(scanner.at, reason),
    })
}

fn header(scanner: &mut Scanner<'_>, parsed: &mut Parsed) -> Result<(Data, Vec<Element>), Fault> {
    let mut data = None;
    let mut elements: Vec<Element> = Vec::new();
    scanner.line();
    for number in 2.. {
        let Some(line) = scanner.line() else {
            return Err(Fault::line(number, "truncated: the header has no `end_header`"));
        };
        let wrong = |reason: &str| Fault::line(number, format!("`{}`: {reason}", text(line)));
        let words: Vec<&str> = str::from_utf8(line).unwrap_or_default().split_whitespace().collect();
        match words[..] {
            ["end_header"] => break,
            ["format", "ascii", _] => data = Some(Data::Text),
            ["format", "binary_little_endian", _] => data = Some(Data::Binary(Order::Little)),
            ["format", "binary_big_endian", _] => data = Some(Data::Binary(Order::Big)),
            ["format", ..] => return Err(wrong("the format is ascii, binary_little_endian or binary_big_endian")),
            ["comment" | "obj_info", ..] => {
                parsed.hints.take(&String::from_utf8_lossy(line).replacen("comment ", "", 1))
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| wrong("the element's count is not a whole number"))?;
                elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
            }
            ["property", ref rest @ ..] => {
                let element = elements.last_mut().ok_or_else(|| wrong("a property before any element"))?;
                let property = property(rest).ok_or_else(|| wrong("a property of an unknown type"))?;
                element.properties.push(property);
            }
            [] => {}
            _ => return Err(wrong("not a line of a PLY header")),
        }
    }
    let data = data.ok_or_else(|| scanner.fault("the header has no `format`"))?;
    Ok((data, elements))
}

fn property(words: &[&str]) -> Option<Property> {
    match words {
        ["list", length, value, name] => {
            Some(Property { name: (*name).to_owned(), length: Some(number(length)?), value: number(value)? })
        }
        [value, name] => Some(Property { name: (*name).to_owned(), length: None, value: number(value)? }),
        _ => None,
    }
}

fn number(name: &str) -> Option<Number> {
    Some(match name {
        "char" | "int8" => Number::I8,
        "uchar" | "uint8" => Number::U8,
        "short" | "int16" => Number::I16,
        "ushort" | "uint16" => Number::U16,
        "int" | "int32" => Number::I32,
        "uint" | "uint32" => Number::U32,
        "int64" => Number::I64,
        "uint64" => Number::U64,
        "float" | "float32" => Number::F32,
        "double" | "float64" => Number::F64,
        _ => return None,
    })
}

/// Reads item `number` of an element type; in a text file, an item is one line. `take` receives the index and the
/// values of each property.
fn record(
    scanner: &mut Scanner<'_>,
    data: Data,
    element: &Element,
    number: usize,
    mut take: impl FnMut(usize, &[f64]) -> Result<(), String>,
) -> Result<(), Fault> {
    let Data::Binary(order) = data else { return text_record(scanner, element, number, take) };
    for (column, property) in element.properties.iter().enumerate() {
        let (at, what) = (scanner.at, property.name.as_str());
        let count = match property.length {
            Some(length) => {
                let count = scanner.numbers(1, length, order, what)?[0];
                let wrong = || Fault::byte(at, format!("the list `{what}` has a length of {count}"));
                if count >= 0.0 { Ok(count as usize) } else { Err(wrong()) }?
            }
            None => 1,
        };
        let values = scanner.numbers(count, property.value, order, what)?;
        take(column, &values).map_err(|reason| Fault::byte(at, reason))?;
    }
    Ok(())
}

fn text_record(
    scanner: &mut Scanner<'_>,
    element: &Element,
    number: usize,
    mut take: impl FnMut(usize, &[f64]) -> Result<(), String>,
) -> Result<(), Fault> {
    let (line, here) = loop {
        let here = scanner.clone();
        match scanner.line() {
            None => {
                let (name, count) = (&element.name, element.count);
                return Err(here.fault(format!("truncated: the file ends before {name} {number} of {count}")));
            }
            Some(line) if !line.trim_ascii().is_empty() => break (line, here),
            Some(_) => {}
        }
    };
    let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    for (column, property) in element.properties.iter().enumerate() {
        let what = property.name.as_str();
        let mut next = || {
            let word = words.next().ok_or_else(|| here.fault(format!("truncated: the line ends before `{what}`")))?;
            finite(word).ok_or_else(|| here.fault(format!("{}; there should be `{what}`", not_a_number(word))))
        };
        let count = if property.length.is_some() { next()? } else { 1.0 };
        if count < 0.0 || count.fract() != 0.0 {
            return Err(here.fault(format!("the list `{what}` has a length of {count}")));
        }
        let values = (0..count as usize).map(|_| next()).collect::<Result<Vec<f64>, Fault>>()?;
        take(column, &values).map_err(|reason| here.fault(reason))?;
    }
    if words.next().is_some() {
        let reason = format!("the line has more values than the header's properties of `{}`", element.name);
        return Err(here.fault(format!("{reason}; export the mesh again")));
    }
    Ok(())
}

fn vertices(scanner: &mut Scanner<'_>, data: Data, element: &Element, parsed: &mut Parsed) -> Result<(), Fault> {
    let column = |axis: &str| element.properties.iter().position(|p| p.name == axis && p.length.is_none());
    let [Some(x), Some(y), Some(z)] = ["x", "y", "z"].map(column) else {
        return Err(scanner.fault("the vertices have no properties x, y and z"));
    };
    let is_plain = element.properties.iter().all(|property| property.length.is_none());
    let size: usize = element.properties.iter().map(|property| property.value.size()).sum();
    for number in 0..element.count {
        if let (Data::Binary(order), true) = (data, is_plain) {
            let bytes = scanner.take(size, "the properties of a vertex")?;
            let at = |column: usize| {
                let start = element.properties[..column].iter().map(|property| property.value.size()).sum();
                bytes.get(start..).map_or(0.0, |rest| element.properties[column].value.read(rest, order))
            };
            parsed.vertices.push(DVec3::new(at(x), at(y), at(z)));
            continue;
        }
        let mut at = DVec3::ZERO;
        record(scanner, data, element, number, |column, found| {
            if let (Some(axis), [value, ..]) = ([x, y, z].iter().position(|p| *p == column), found) {
                at[axis] = *value;
            }
            Ok(())
        })?;
        parsed.vertices.push(at);
    }
    Ok(())
}

fn faces(
    scanner: &mut Scanner<'_>,
    data: Data,
    element: &Element,
    vertices: &[DVec3],
    draft: &mut Draft,
) -> Result<(), Fault> {
    let is_list = |property: &Property| {
        ["vertex_indices", "vertex_index"].contains(&property.name.as_str()) && property.length.is_some()
    };
    if element.count > 0 && !element.properties.iter().any(is_list) {
        return Err(scanner.fault(format!("the element `{}` has no list `vertex_indices`", element.name)));
    }
    let is_strip = element.name == "tristrips";
    for face in 0..element.count {
        record(scanner, data, element, face, |column, found| {
            if !is_list(&element.properties[column]) {
                return Ok(());
            }
            // In a list of strips, -1 ends a strip.
            for part in found.split(|value| is_strip && *value == -1.0) {
                let wrong =
                    |value: f64| format!("face {face} names vertex {value} of {}, counted from 0", vertices.len());
                let corners = part.iter().map(|value| index(*value, vertices.len()).ok_or_else(|| wrong(*value)));
                let corners = corners.collect::<Result<Vec<u32>, _>>()?;
                if is_strip { draft.strip(&corners) } else { draft.polygon(&corners, vertices) }
            }
            Ok(())
        })?;
    }
    Ok(())
}
