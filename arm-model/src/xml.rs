//! XML elements whose attributes are numbers and names.

use std::io;

use quick_xml::Writer;
use quick_xml::events::{BytesEnd, BytesStart, BytesText, Event};

use crate::chain::Axes;

pub(crate) struct XmlDocument {
    writer: Writer<Vec<u8>>,
    open: Vec<&'static str>,
}

pub(crate) type Attributes<'a> = &'a [(&'static str, String)];

impl XmlDocument {
    pub(crate) fn new() -> Self {
        Self { writer: Writer::new_with_indent(Vec::new(), b' ', 2), open: Vec::new() }
    }

    pub(crate) fn comment(&mut self, text: &str) -> io::Result<()> {
        self.writer.write_event(Event::Comment(BytesText::from_escaped(format!(" {text} "))))
    }

    /// Begins an element; [`XmlDocument::end`] ends it.
    pub(crate) fn begin(&mut self, name: &'static str, attributes: Attributes) -> io::Result<()> {
        self.open.push(name);
        self.writer.write_event(Event::Start(element(name, attributes)))
    }

    /// Ends the innermost open element.
    pub(crate) fn end(&mut self) -> io::Result<()> {
        match self.open.pop() {
            Some(name) => self.writer.write_event(Event::End(BytesEnd::new(name))),
            None => Ok(()),
        }
    }

    /// Writes an element without content.
    pub(crate) fn empty(&mut self, name: &'static str, attributes: Attributes) -> io::Result<()> {
        self.writer.write_event(Event::Empty(element(name, attributes)))
    }

    /// Ends all open elements, and returns the text.
    pub(crate) fn finish(mut self) -> io::Result<String> {
        while !self.open.is_empty() {
            self.end()?;
        }
        let mut bytes = self.writer.into_inner();
        bytes.push(b'\n');
        String::from_utf8(bytes).map_err(io::Error::other)
    }
}

fn element(name: &'static str, attributes: Attributes) -> BytesStart<'static> {
    let mut element = BytesStart::new(name);
    for (name, value) in attributes {
        element.push_attribute((*name, value.as_str()));
    }
    element
}

/// Three numbers, each as [`number`] writes it.
pub(crate) fn triple(axes: Axes) -> String {
    axes.map(number).join(" ")
}

/// A number with at most twelve decimals. -0 is written as 0.
pub(crate) fn number(value: f64) -> String {
    ((value * 1e12).round() / 1e12 + 0.0).to_string()
}
