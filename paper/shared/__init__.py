"""What scripts of the paper share: rows, looks, and the skins that estimators are judged on."""
