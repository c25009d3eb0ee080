//! `glArrayElement`: a vertex of the arrays between Begin and End.

use crate::arrays::{Arrays, Source};
use crate::context::{Context, Sink};

impl Context {
    /// Values of element `i` become current, and a vertex of the primitive that is recorded or compiled.
    pub(crate) fn array_element(&mut self, i: i32) -> bool {
        match self.sink {
            Sink::Trace => {}
            Sink::List if self.recording.as_ref().is_some_and(|r| r.is_open()) => {}
            Sink::List => {
                if let Some(r) = &mut self.recording {
                    r.note_driver_call(0, false, true);
                }
                return false;
            }
            Sink::Pass => return false,
            // Values become current, and that is all.
            Sink::Outside => {
                self.mark_current();
                return false;
            }
        }
        let why = match self.take_element(i) {
            Ok(taken) => return taken,
            Err(why) => why,
        };
        match self.sink {
            Sink::Trace => self.unswallow(why),
            _ => {
                if let Some(r) = &mut self.recording {
                    r.note_driver_call(0, false, true);
                }
            }
        }
        false
    }

    fn take_element(&mut self, i: i32) -> Result<bool, &'static str> {
        let i = usize::try_from(i).map_err(|_| "an element of a negative number")?;
        // Nothing about arrays can change before End.
        let arrays = match self.element_arrays {
            Some(arrays) => arrays,
            None => *self.element_arrays.insert(Arrays::query(self.can.version)?),
        };
        let [normal, color, tex] = [arrays.normal, arrays.color, arrays.tex];
        let position = value(arrays.position, i)?;
        let [normal, color, tex] = [of(normal, i)?, of(color, i)?, of(tex, i)?];
        if let Some([x, y, z, _]) = normal {
            self.normal([x, y, z]);
        }
        if let Some(c) = color {
            self.color(c);
        }
        if let Some(t) = tex {
            self.tex_coord(t);
        }
        Ok(self.vertex(position))
    }
}

fn of(source: Option<Source>, i: usize) -> Result<Option<[f32; 4]>, &'static str> {
    source.map(|s| value(s, i)).transpose()
}

fn value(source: Source, i: usize) -> Result<[f32; 4], &'static str> {
    Ok(source.read(i, 1)?.at(0, [0.0, 0.0, 0.0, 1.0]))
}
