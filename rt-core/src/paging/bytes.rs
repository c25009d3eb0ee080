//! Where the bytes of a file are: in a file of another member, in memory, or elsewhere.

/// Bytes that a stored mesh or volume is read from.
pub trait PageSource: Send + Sync {
    /// What errors call the bytes: the path of a file, for example.
    fn name(&self) -> String;

    /// How many there are now.
    ///
    /// # Errors
    /// What was tried, and why it failed.
    fn length(&self) -> Result<u64, String>;

    /// Fills `bytes` with those from `offset` on. Several threads read at once.
    ///
    /// # Errors
    /// What was tried, and why it failed; also where there are fewer bytes.
    fn read(&self, offset: u64, bytes: &mut [u8]) -> Result<(), String>;
}

/// Bytes that a mesh or volume is stored in.
pub trait PageSink {
    /// What errors call the bytes.
    fn name(&self) -> String;

    /// Appends bytes.
    ///
    /// # Errors
    /// What was tried, and why it failed.
    fn append(&mut self, bytes: &[u8]) -> Result<(), String>;

    /// Replaces the first bytes, of which there are enough. Called once, as the last.
    ///
    /// # Errors
    /// What was tried, and why it failed.
    fn replace_start(&mut self, bytes: &[u8]) -> Result<(), String>;
}

impl PageSource for Vec<u8> {
    fn name(&self) -> String {
        "bytes in memory".into()
    }

    fn length(&self) -> Result<u64, String> {
        Ok(self.len() as u64)
    }

    fn read(&self, offset: u64, bytes: &mut [u8]) -> Result<(), String> {
        let found = usize::try_from(offset).ok().and_then(|at| self.get(at..)?.get(..bytes.len()));
        let found =
            found.ok_or_else(|| format!("no {} bytes from byte {offset} on", bytes.len()))?;
        bytes.copy_from_slice(found);
        Ok(())
    }
}

impl PageSink for Vec<u8> {
    fn name(&self) -> String {
        "bytes in memory".into()
    }

    fn append(&mut self, bytes: &[u8]) -> Result<(), String> {
        self.try_reserve(bytes.len()).map_err(|e| e.to_string())?;
        self.extend_from_slice(bytes);
        Ok(())
    }

    fn replace_start(&mut self, bytes: &[u8]) -> Result<(), String> {
        let start = self.get_mut(..bytes.len()).ok_or("nothing was written")?;
        start.copy_from_slice(bytes);
        Ok(())
    }
}
