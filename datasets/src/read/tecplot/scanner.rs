//! Words, texts and lists of a Tecplot text file.

use crate::read::error::{At, BROKEN, Fault, TRUNCATED};

/// The value of a keyword.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value<'a> {
    /// A word or a text in quotes.
    Word(&'a str),
    /// What stands between parentheses or brackets.
    List(&'a str),
}

impl<'a> Value<'a> {
    /// The characters, whatever stood around them.
    pub(super) fn text(&self) -> &'a str {
        match self {
            Value::Word(t) | Value::List(t) => t,
        }
    }
}

/// A read position in the text.
#[derive(Debug, Clone)]
pub(super) struct Scanner<'a> {
    text: &'a str,
    pos: usize,
}

fn separates(b: u8) -> bool {
    b.is_ascii_whitespace() || b == b','
}

impl<'a> Scanner<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Scanner { text, pos: 0 }
    }

    /// The line of the position.
    pub(super) fn at(&self) -> At {
        let before = &self.text.as_bytes()[..self.pos.min(self.text.len())];
        At::Line(1 + before.iter().filter(|&&b| b == b'\n').count() as u64)
    }

    pub(super) fn fault(&self, what: impl Into<String>) -> Fault {
        Fault::new(self.at(), what, BROKEN)
    }

    /// Bytes that follow.
    pub(super) fn remaining(&self) -> usize {
        self.text.len() - self.pos
    }

    /// Goes to the next word, over separators and comments. The next byte, `None` at the end.
    pub(super) fn peek(&mut self) -> Option<u8> {
        let bytes = self.text.as_bytes();
        while let Some(&b) = bytes.get(self.pos) {
            if b == b'#' {
                let rest = &bytes[self.pos..];
                self.pos += rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
            } else if separates(b) {
                self.pos += 1;
            } else {
                return Some(b);
            }
        }
        None
    }

    /// The next word: up to a separator or one of `=([{"#`.
    pub(super) fn word(&mut self) -> Option<&'a str> {
        self.peek()?;
        let rest = &self.text.as_bytes()[self.pos..];
        let ends = |b: &u8| separates(*b) || b"=([\"#".contains(b);
        let len = rest.iter().position(ends).unwrap_or(rest.len());
        let start = self.pos;
        // A character that ends a word and stands alone is one.
        self.pos += len.max(1);
        self.text.get(start..self.pos)
    }

    /// The next word, without going there.
    pub(super) fn next_word(&self) -> Option<&'a str> {
        self.clone().word()
    }

    /// Whether the next word is a keyword with a value: `WORD =`.
    pub(super) fn has_key(&self) -> bool {
        let mut ahead = self.clone();
        ahead.word().is_some() && ahead.peek() == Some(b'=')
    }

    /// Goes over `=`.
    pub(super) fn equals(&mut self, key: &str) -> Result<(), Fault> {
        if self.peek() != Some(b'=') {
            return Err(self.fault(format!("`{}` without =", short(key))));
        }
        self.pos += 1;
        Ok(())
    }

    /// A word, a text in quotes or a list in parentheses or brackets.
    pub(super) fn value(&mut self) -> Result<Value<'a>, Fault> {
        let ends = match self.peek() {
            None => return Err(Fault::new(self.at(), "the file ends in a header", TRUNCATED)),
            Some(b'"') => b'"',
            Some(b'(') => b')',
            Some(b'[') => b']',
            Some(_) => return Ok(Value::Word(self.word().unwrap_or_default())),
        };
        let start = self.pos + 1;
        let rest = &self.text.as_bytes()[start..];
        let Some(len) = rest.iter().position(|&b| b == ends) else {
            let what = format!("no closing {} follows", char::from(ends));
            return Err(Fault::new(self.at(), what, TRUNCATED));
        };
        self.pos = start + len + 1;
        let inside = self.text.get(start..start + len).unwrap_or_default();
        Ok(if ends == b'"' { Value::Word(inside) } else { Value::List(inside) })
    }

    /// The next word of numbers, which only separators and comments end.
    fn number_word(&mut self) -> Option<&'a str> {
        self.peek()?;
        let rest = &self.text.as_bytes()[self.pos..];
        let len = rest.iter().position(|&b| separates(b)).unwrap_or(rest.len());
        let start = self.pos;
        self.pos += len;
        self.text.get(start..self.pos)
    }

    /// A number, and how often it stands there (`10*1.5`).
    pub(super) fn repeated<T>(
        &mut self,
        what: &dyn Fn() -> String,
        parse: impl Fn(&str) -> Option<T>,
    ) -> Result<(u64, T), Fault> {
        let before = self.pos;
        let Some(word) = self.number_word() else {
            let what = format!("the file ends among the {}", what());
            return Err(Fault::new(self.at(), what, TRUNCATED));
        };
        let (times, number) = match word.split_once('*') {
            Some((times, number)) => (times.parse().ok(), number),
            None => (Some(1), word),
        };
        match (times, parse(number)) {
            (Some(times), Some(number)) => Ok((times, number)),
            _ => {
                self.pos = before;
                self.peek();
                Err(self.fault(format!("`{}` among the {}", short(word), what())))
            }
        }
    }
}

/// A word as messages show it.
pub(super) fn short(word: &str) -> String {
    word.chars().take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_texts_lists_and_comments() {
        let mut s =
            Scanner::new("# made by hand\nZONE T = \"a # b\", I=3\nVARLOCATION=([3]=NODAL)");
        assert_eq!(s.word(), Some("ZONE"));
        assert!(s.has_key());
        assert_eq!(s.word(), Some("T"));
        s.equals("T").unwrap();
        assert_eq!(s.value().unwrap(), Value::Word("a # b"));
        assert_eq!((s.word(), s.at()), (Some("I"), At::Line(2)));
        s.equals("I").unwrap();
        assert_eq!(s.value().unwrap(), Value::Word("3"));
        s.word();
        s.equals("VARLOCATION").unwrap();
        assert_eq!(s.value().unwrap(), Value::List("[3]=NODAL"));
        assert_eq!((s.peek(), s.word()), (None, None));
    }
}
